"""The nominal servo law, and the servo bank that brings it into a Drake diagram."""

from workbench.servo.bank import AddServos, ServoBank, SetServoPhysics
from workbench.servo.law import ServoLaw, advance_reference

__all__ = ["AddServos", "ServoBank", "ServoLaw", "SetServoPhysics", "advance_reference"]
