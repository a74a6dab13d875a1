"""The nominal servo law, and the servo bank that brings it, and terms beyond it, into a Drake diagram."""

from workbench.servo.bank import AddServos, SetServoPhysics
from workbench.servo.law import ServoLaw
from workbench.servo.load_friction import LoadFrictionTerm
from workbench.servo.nominal import nominal_terms
from workbench.servo.system import ServoBank
from workbench.servo.term_bank import TermBank
from workbench.servo.terms import Instant, ServoTerm, TermNumbers

__all__ = ["AddServos", "Instant", "LoadFrictionTerm", "ServoBank", "ServoLaw", "ServoTerm", "SetServoPhysics", "TermBank",
           "TermNumbers", "nominal_terms"]
