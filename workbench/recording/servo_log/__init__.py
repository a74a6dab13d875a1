"""Checks of servo logs: units, state, leaps, lead over the goal, plausibility against the robot."""
