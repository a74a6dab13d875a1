"""Checks of servo logs: units, state, leaps, goals that lag the motion, plausibility for the robot."""
