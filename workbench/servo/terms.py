"""What a servo may do beyond the nominal law, at each instant: terms of a TermBank."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.servo.law import ServoLaw

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Instant:
    """Of n servos now. elapsed: since the first command, 0 before it [s]; velocity (n,) of the joints [rad/s]; duty (n,), 0 with
    torque disabled; load (n,): torque that each servo hands to its link [N m], as TermBank finds it."""

    elapsed: float
    velocity: Array
    duty: Array
    load: Array


@dataclass(frozen=True)
class TermNumbers:
    """A term in numbers, by which it can be computed elsewhere than here. ceiling (n,) [N m]; sag [V] lost for each servo at full
    duty; fade [1/s]; sticking (n,) [N m] more friction at rest, fading as exp(-(w / speed)^2), speed [rad/s]; rubbing (n,):
    friction by load."""

    ceiling: Array | None = None
    sag: float = 0.0
    fade: float = 0.0
    sticking: Array | None = None
    speed: float = 1.0
    rubbing: Array | None = None


class ServoTerm:
    """Does nothing unless overridden. What it returns is for all servos (n,), or one number for all."""

    def numbers(self) -> TermNumbers | None:
        """All that the term does, in numbers; None where they do not say it."""
        return None

    def strength(self, law: ServoLaw, now: Instant) -> Array | float:
        """What is left of the duty torque, 0 to 1."""
        return 1.0

    def ceiling(self) -> Array | float:
        """Most of the motor's torque, duty torque less back-EMF [N m]."""
        return np.inf

    def friction(self, now: Instant) -> Array | float:
        """Dry friction beyond the law's Coulomb friction [N m], not negative."""
        return 0.0

    def most_friction(self, law: ServoLaw) -> Array | float:
        """The most that `friction` may ask for [N m]; above 0 where it varies."""
        return 0.0


def most_friction(terms: Sequence[ServoTerm], law: ServoLaw) -> Array:
    """The most dry friction of each servo, Coulomb's included (n,) [N m]."""
    most = law.coulomb.copy()
    for term in terms:
        most = most + term.most_friction(law)
    return most
