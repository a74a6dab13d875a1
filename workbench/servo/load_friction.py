"""Dry friction that grows with the gear's load, in the nominal law and in effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.servo.law import ServoLaw
from workbench.servo.terms import Instant, ServoTerm, TermNumbers
from workbench.types import Array

MOST_LOAD = 2.0
"""Load, as a share of the torque at full duty, beyond which friction grows no further: the solver needs a bound."""


@dataclass(frozen=True)
class LoadFrictionTerm(ServoTerm):
    """Shares of the load (n,): coefficient always, static more at rest, which fades as exp(-(w / speed)^2), speed [rad/s],
    backdrive more where the load drives the motor."""

    coefficient: Array
    static: Array
    speed: float
    backdrive: Array

    def friction(self, now: Instant) -> Array:
        """Friction (n,) [N m] at the present load."""
        share = self.coefficient + self.static * np.exp(-np.square(now.velocity / self.speed))
        share = share + self.backdrive * np.maximum(-np.sign(now.motor) * now.direction, 0.0)
        return np.asarray(share * np.abs(now.load))

    def most_friction(self, law: ServoLaw) -> Array:
        """Friction (n,) [N m] at MOST_LOAD."""
        return np.asarray((self.coefficient + self.static + self.backdrive) * MOST_LOAD * law.full_torque)

    def numbers(self) -> TermNumbers:
        """All numbers of the term."""
        return TermNumbers(rubbing=self.coefficient, rubbing_still=self.static, rubbing_speed=self.speed,
                           rubbing_backwards=self.backdrive)
