"""A real arm of STS3215 servos: what each of its joints lacks, from named programmes."""
