"""Servos: effects on constants, and on what happens between error and joint at each instant (docs/formats.md, section 7)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.other_engine.hidden.values import angle, number, optional
from studies.other_engine.servo import ServoBank
from workbench.robot import EffectSpec
from workbench.types import Array


@dataclass(frozen=True)
class Instant:
    """t [s] since the first command, step [s]; servo angles q and speeds v (n,) [rad, rad/s]; link: angles of the links
    against their parents about the servos' axes (n,); duty (n,) before anything takes from it; load (n,): torque that
    each servo hands to its link [N m]; motor (n,): torque of the motors; rubbed (n,): that of dry friction, each as it was a step
    ago."""

    t: float
    step: float
    q: Array
    v: Array
    link: Array
    duty: Array
    load: Array
    motor: Array
    rubbed: Array

    @property
    def way(self) -> Array:
        """1 or -1: where each servo turns, or, at rest, where friction keeps it from turning."""
        return np.where(np.abs(self.v) > 5e-3, np.sign(self.v), -np.sign(self.rubbed))


class StepEffect:
    """Does nothing unless overridden. Results are for every servo (n,), or one number for all."""

    needs_load = False

    def __init__(self, columns: NDArray[np.int_], n: int) -> None:
        self.here = np.zeros(n)
        """1 where the effect is, else 0."""
        self.here[columns] = 1.0

    def sensor_error(self, q: Array) -> Array | float:
        """Error of the sensor, added to the angle q [rad]."""
        return 0.0

    def strength(self, now: Instant, supply: Array) -> Array | float:
        """Factor on the duty's torque, 0 to 1, of servos at `supply` (n,) [V]."""
        return 1.0

    def ceiling(self) -> Array | float:
        """Most of the motor's torque [N m]."""
        return np.inf

    def saturated(self, torque: Array) -> Array:
        """The part of the motor's torque that acts (n,) [N m]."""
        return torque

    def friction(self, now: Instant) -> Array | float:
        """Coulomb friction beyond the constant [N m]."""
        return 0.0

    def friction_ratio(self, now: Instant) -> Array | float:
        """What all Coulomb friction is times."""
        return 1.0

    def link_torque(self, now: Instant) -> Array | float:
        """On the links, past the servos [N m]."""
        return 0.0


class SupplySag(StepEffect):
    """One battery for all: `drop` V for each servo at full duty."""

    def __init__(self, columns: NDArray[np.int_], n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.drop = number(spec, "drop")

    def strength(self, now: Instant, supply: Array) -> Array:
        return np.maximum(supply - self.drop * np.abs(now.duty).sum(), 0.0) / supply


class TorqueCeiling(StepEffect):
    """The motor's torque, duty torque less back-EMF, goes to `torque` and no farther."""

    def __init__(self, columns: NDArray[np.int_], n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.most = np.where(self.here > 0, number(spec, "torque"), np.inf)

    def ceiling(self) -> Array:
        return self.most


class TorqueSaturation(StepEffect):
    """The motor's torque x, duty torque less back-EMF, acts as x / (1 + |x| / `torque`)."""

    def __init__(self, columns: NDArray[np.int_], n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.bend = self.here / number(spec, "torque")

    def saturated(self, torque: Array) -> Array:
        return torque / (1 + self.bend * np.abs(torque))


class ThermalFade(StepEffect):
    """Duty torque times exp(-rate t) from the first command."""

    def __init__(self, columns: NDArray[np.int_], n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.rate = number(spec, "rate")

    def strength(self, now: Instant, supply: Array) -> float:
        return float(np.exp(-self.rate * max(now.t, 0.0)))


class StribeckFriction(StepEffect):
    """`torque` more at rest, that fades as exp(-(v / speed)²)."""

    def __init__(self, columns: NDArray[np.int_], n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.torque, self.speed = number(spec, "torque"), angle(spec, "speed")

    def friction(self, now: Instant) -> Array:
        return self.here * self.torque * np.exp(-np.square(now.v / self.speed))


class LoadFriction(StepEffect):
    """Coulomb friction grows by `coefficient` times the torque of the joint on its link (not the motor's torque), by `static`
    times that more at rest, fading as exp(-(v / speed)²), by `backdrive` times more where the motor pulls against the motion."""

    needs_load = True
    SMOOTH = 2e-3
    """Friction that follows the load at once would feed on itself from step to step [s]."""

    def __init__(self, columns: NDArray[np.int_], n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.coefficient, self.load = number(spec, "coefficient"), np.zeros(n)
        self.static, self.backdrive = optional(spec, "static"), optional(spec, "backdrive")
        self.speed = angle(spec, "speed") if self.static else 1.0

    def friction(self, now: Instant) -> Array:
        self.load += (now.load - self.load) * now.step / (now.step + self.SMOOTH)
        share = self.coefficient + self.static * np.exp(-np.square(now.v / self.speed))
        share = share + self.backdrive * (now.way * now.motor < 0)
        return self.here * share * np.abs(self.load)


class FrictionAsymmetry(StepEffect):
    """All Coulomb friction is `ratio` times as much forwards as backwards, with the mean unchanged."""

    needs_load = True

    def __init__(self, columns: NDArray[np.int_], n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.share = self.here * (number(spec, "ratio") - 1) / (number(spec, "ratio") + 1)

    def friction_ratio(self, now: Instant) -> Array:
        return 1 + self.share * now.way


STEP: dict[str, Callable[[NDArray[np.int_], int, EffectSpec, np.random.Generator], StepEffect]] = {
    "supply_sag": SupplySag, "torque_ceiling": TorqueCeiling, "thermal_fade": ThermalFade,
    "stribeck_friction": StribeckFriction, "load_friction": LoadFriction, "torque_saturation": TorqueSaturation,
    "friction_asymmetry": FrictionAsymmetry,
}


def _coulomb(bank: ServoBank, i: NDArray[np.int_], spec: EffectSpec) -> None:
    bank.coulomb[i] += number(spec, "torque")


def _viscous(bank: ServoBank, i: NDArray[np.int_], spec: EffectSpec) -> None:
    bank.viscous[i] += number(spec, "coefficient")


def _voltage(bank: ServoBank, i: NDArray[np.int_], spec: EffectSpec) -> None:
    bank.full_torque *= number(spec, "voltage") / bank.supply
    bank.supply[:] = number(spec, "voltage")


def _gain(bank: ServoBank, i: NDArray[np.int_], spec: EffectSpec) -> None:
    bank.slope[i] /= number(spec, "ratio")


def _dead_band(bank: ServoBank, i: NDArray[np.int_], spec: EffectSpec) -> None:
    bank.margin[i] += angle(spec, "margin")


def _inertia(bank: ServoBank, i: NDArray[np.int_], spec: EffectSpec) -> None:
    bank.inertia[i] += number(spec, "inertia")


def _ramp(bank: ServoBank, i: NDArray[np.int_], spec: EffectSpec) -> None:
    bank.ramp[i] = np.minimum(bank.ramp[i], angle(spec, "speed"))


def _lag(bank: ServoBank, i: NDArray[np.int_], spec: EffectSpec) -> None:
    bank.lag[i] += number(spec, "time")


def _derivative(bank: ServoBank, i: NDArray[np.int_], spec: EffectSpec) -> None:
    bank.derivative[i] += number(spec, "gain")


def _minimum_duty(bank: ServoBank, i: NDArray[np.int_], spec: EffectSpec) -> None:
    steepness = (1 - bank.punch[i]) / bank.slope[i]  # stays
    bank.punch[i] += number(spec, "duty")
    bank.slope[i] = (1 - bank.punch[i]) / steepness


CONSTANTS: dict[str, Callable[[ServoBank, NDArray[np.int_], EffectSpec], None]] = {
    "coulomb_friction": _coulomb, "viscous_friction": _viscous, "supply_voltage": _voltage, "servo_gain": _gain,
    "dead_band": _dead_band, "reflected_inertia": _inertia, "goal_ramp": _ramp, "command_filter": _lag,
    "damping_gain": _derivative, "minimum_duty": _minimum_duty,
}


class Drive:
    """A bank of servos with hidden effects."""

    def __init__(self, servos: ServoBank, effects: Sequence[StepEffect] = ()) -> None:
        self.servos, self.effects = servos, tuple(effects)
        self.most = np.full(len(servos.coulomb), np.inf)
        for e in self.effects:
            self.most = np.minimum(self.most, e.ceiling())

    def acting(self, torque: Array) -> Array:
        """The part of the motors' torque that acts (n,) [N m]."""
        for e in self.effects:
            torque = e.saturated(torque)
        return np.clip(torque, -self.most, self.most)

    @property
    def needs_load(self) -> bool:
        """Whether `Instant.load` and `Instant.rubbed` are read."""
        return any(e.needs_load for e in self.effects)

    def sensed(self, q: Array) -> Array:
        """The angle that the servos steer by."""
        for e in self.effects:
            q = q + e.sensor_error(q)
        return q

    def strength(self, now: Instant) -> Array | float:
        """Factor on the duty's torque."""
        left: Array | float = 1.0
        for e in self.effects:
            left = left * e.strength(now, self.servos.supply)
        return left

    def friction(self, now: Instant) -> Array:
        """Coulomb friction of each servo [N m]."""
        total, ratio = self.servos.coulomb.copy(), np.ones_like(self.servos.coulomb)
        for e in self.effects:
            total += e.friction(now)
            ratio *= e.friction_ratio(now)
        return total * ratio

    def link_torque(self, now: Instant) -> Array:
        """On the links, past the servos [N m]."""
        total = np.zeros_like(now.q)
        for e in self.effects:
            total += e.link_torque(now)
        return total
