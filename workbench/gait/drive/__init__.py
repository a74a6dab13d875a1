"""Driving: once a cycle a model-predictive controller chooses how much the next cycle turns, so that the robot follows a path."""
