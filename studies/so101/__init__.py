"""A real arm of STS3215 servos: deviations of each joint from nominal, from named programmes."""
