"""Recognises files by their content and checks them against the robot they belong to."""
