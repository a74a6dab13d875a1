"""Gaits that a robot's servos can follow: asked for, found, certified."""
