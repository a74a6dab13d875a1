"""Several robots of one structure on one schedule, each in a lane of the processor's vectors."""
