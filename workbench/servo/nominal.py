"""The nominal law's behaviour of servos beyond constants: friction by load, and torques given as tables."""

from __future__ import annotations

import numpy as np

from workbench.servo.law import ServoLaw
from workbench.servo.load_friction import LoadFrictionTerm
from workbench.servo.tabled import Tabled
from workbench.servo.terms import ServoTerm


def nominal_terms(law: ServoLaw) -> tuple[ServoTerm, ...]:
    """What servos do by the nominal law beyond motor, Coulomb and viscous friction: none, load friction, tables of torque."""
    out: list[ServoTerm] = []
    if law.load_friction.any():
        none = np.zeros_like(law.load_friction)
        out.append(LoadFrictionTerm(law.load_friction, none, 1.0, none))
    if law.tables:
        out.append(Tabled(law.tables, len(law.gain)))
    return tuple(out)
