"""Behaviour of a servo beyond the nominal law, at each instant: terms of a TermBank."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.robot.torque_table import TorqueTable
from workbench.servo.law import ServoLaw
from workbench.types import Array


@dataclass(frozen=True)
class Instant:
    """State of n servos at an instant. elapsed: since the first command, 0 before it [s]; velocity (n,) and angle (n,) of the
    joints [rad/s, rad]; duty (n,), 0 with torque disabled; load (n,): torque that each servo hands to its link [N m], as TermBank
    finds it. Known where friction is asked: motor (n,): torque of the motor [N m]; direction (n,), -1 to 1: in which the joint
    turns, or would but for friction."""

    elapsed: float
    velocity: Array
    duty: Array
    load: Array
    motor: Array
    direction: Array
    angle: Array


@dataclass(frozen=True)
class TermNumbers:
    """A term in numbers, by which it can be computed elsewhere than here. ceiling (n,) [N m]; sag [V] lost for each servo at
    full duty; fade [1/s]; sticking (n,) [N m] more friction at rest, fading as exp(-(w / speed)^2), speed [rad/s]; rubbing
    (n,): friction by load, rubbing_still (n,) more at rest, fading likewise by rubbing_speed [rad/s], rubbing_backwards (n,)
    more where the load drives the motor; bend (n,) [1/(N m)]: one over the torque at which the motor saturates; lopsided (n,):
    share by which friction is more forwards and less backwards; tables: torques, each with the number of its servo."""

    ceiling: Array | None = None
    sag: float = 0.0
    fade: float = 0.0
    sticking: Array | None = None
    speed: float = 1.0
    rubbing: Array | None = None
    rubbing_still: Array | None = None
    rubbing_speed: float = 1.0
    rubbing_backwards: Array | None = None
    bend: Array | None = None
    lopsided: Array | None = None
    tables: tuple[tuple[int, TorqueTable], ...] = ()


class ServoTerm:
    """Does nothing unless overridden. Its results are for every servo (n,), or one number for all."""

    def numbers(self) -> TermNumbers | None:
        """All that the term does, in numbers; None where they do not say it."""
        return None

    def strength(self, law: ServoLaw, now: Instant) -> Array | float:
        """Factor on the duty torque, 0 to 1."""
        return 1.0

    def ceiling(self) -> Array | float:
        """Most of the motor's torque, duty torque less back-EMF [N m]."""
        return np.inf

    def saturation(self) -> Array | float:
        """Torque s [N m] by which the motor's, x, acts as x / (1 + |x|/s)."""
        return np.inf

    def more_torque(self, now: Instant) -> Array | float:
        """Torque on the joint beyond the motor's and friction [N m]."""
        return 0.0

    def friction(self, now: Instant) -> Array | float:
        """Dry friction beyond the law's Coulomb friction [N m], not negative."""
        return 0.0

    def most_friction(self, law: ServoLaw) -> Array | float:
        """The most that `friction` may ask for [N m]; above 0 where it varies."""
        return 0.0

    def friction_ratio(self, now: Instant) -> Array | float:
        """What all dry friction is times, by direction."""
        return 1.0

    def most_friction_ratio(self) -> Array | float:
        """The most that `friction_ratio` may be."""
        return 1.0


def most_friction(terms: Sequence[ServoTerm], law: ServoLaw) -> Array:
    """The most dry friction of each servo, Coulomb's included (n,) [N m]."""
    most, ratio = law.coulomb.copy(), np.ones_like(law.coulomb)
    for term in terms:
        most = most + term.most_friction(law)
        ratio = ratio * term.most_friction_ratio()
    return np.asarray(most * ratio)


def wanted_friction(terms: Sequence[ServoTerm], law: ServoLaw, now: Instant) -> Array:
    """The dry friction of each servo, Coulomb's included (n,) [N m]."""
    friction, ratio = law.coulomb, np.ones_like(law.coulomb)
    for term in terms:
        friction = friction + term.friction(now)
        ratio = ratio * term.friction_ratio(now)
    return np.asarray(friction * ratio)
