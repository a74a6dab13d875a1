"""Motions as tables of poses, and what they become on the bus."""
