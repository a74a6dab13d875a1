"""The next experiment: a motion within the servos' limits that separates models which a session leaves tied."""
