"""Pose tables for the controller, in text and binary form, and the limits that they keep."""
