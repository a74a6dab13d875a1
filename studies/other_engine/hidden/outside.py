"""Physics outside the vocabulary. An honest diagnosis reports an unexplained residual, and the signal it depends on.

| effect | where | parameters |
|---|---|---|
| `gear_ripple` | joint | `torque` N m of friction, `period` deg: 0 to `torque` more over the joint's angle |
| `sensor_ripple` | joint | `amplitude` deg, `period` deg: the potentiometer's error over the angle |
| `taut_cable` | joint | `from` deg, `stiffness` N m/rad: pulls back only beyond that angle (below it, where it is negative) |
| `warming_friction` | joint | `torque` N m more, of which its own work of `heat` J warms `share` away |
| `friction_memory` | joint | `torque` N m, `speed` deg/s, `time` s: Stribeck friction that lags behind the speed |
| `one_way_friction` | joint | `torque` N m more where it turns to positive angles |
| `power_dips` | – | `share` of torque lost, `length` s, `rate` 1/s: a loose plug, at random |
| `swinging_mass` | link | `mass` kg, `length` m, `position` m: hangs from a point of the link, about its y axis |
| `floor_step` | – | `height` m, `x` m in the world: the floor is higher from there on |
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from studies.other_engine.description import Description, LinkPart, SeriesJoint, Surroundings
from studies.other_engine.hidden.body import Around, Build
from studies.other_engine.hidden.drive import Instant, StepEffect
from studies.other_engine.hidden.values import angle, number, vector
from workbench.robot import EffectSpec
from workbench.types import Array

Columns = NDArray[np.int_]


class GearRipple(StepEffect):
    """A worn gear: it goes hard once in each period of the angle."""

    def __init__(self, columns: Columns, n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.torque, self.k = number(spec, "torque"), 2 * np.pi / angle(spec, "period")

    def friction(self, now: Instant) -> Array:
        return self.here * self.torque * 0.5 * (1 + np.sin(self.k * now.q))


class SensorRipple(StepEffect):
    """A potentiometer that is not linear: the servo steers by an angle that is not the true one."""

    def __init__(self, columns: Columns, n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.size, self.k = angle(spec, "amplitude"), 2 * np.pi / angle(spec, "period")

    def sensor_error(self, q: Array) -> Array:
        return self.here * self.size * np.sin(self.k * q)


class TautCable(StepEffect):
    """A cable that is slack up to an angle of the link."""

    def __init__(self, columns: Columns, n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.start, self.stiffness = angle(spec, "from"), number(spec, "stiffness")

    def link_torque(self, now: Instant) -> Array:
        side = np.sign(self.start)
        return -self.here * side * self.stiffness * np.maximum(side * (now.link - self.start), 0.0)


class WarmingFriction(StepEffect):
    """Grease that thins with the heat of the friction's own work."""

    def __init__(self, columns: Columns, n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.share, self.scale, self.cold = number(spec, "share"), number(spec, "heat"), number(spec, "torque")
        self.heat = np.zeros(n)

    def friction(self, now: Instant) -> Array:
        torque = self.here * self.cold * (1 - self.share * (1 - np.exp(-self.heat / self.scale)))
        self.heat += torque * np.abs(now.v) * now.step
        return torque


class FrictionMemory(StepEffect):
    """Stribeck's friction of a film that takes its time: it follows a speed that lags."""

    def __init__(self, columns: Columns, n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.torque, self.speed, self.time = number(spec, "torque"), angle(spec, "speed"), number(spec, "time")
        self.film = np.zeros(n)

    def friction(self, now: Instant) -> Array:
        self.film += (np.abs(now.v) - self.film) * now.step / (now.step + self.time)
        return self.here * self.torque * np.exp(-np.square(self.film / self.speed))


class OneWayFriction(StepEffect):
    """A gear that is harder to turn one way."""

    def __init__(self, columns: Columns, n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.torque = number(spec, "torque")

    def friction(self, now: Instant) -> Array:
        return self.here * self.torque * 0.5 * (1 + np.tanh(now.v / 0.02))


class PowerDips(StepEffect):
    """A plug that loses contact for a moment, at random."""

    HORIZON = 60.0

    def __init__(self, columns: Columns, n: int, spec: EffectSpec, rng: np.random.Generator) -> None:
        super().__init__(columns, n)
        self.share, self.length = number(spec, "share"), number(spec, "length")
        self.starts = np.sort(rng.uniform(0, self.HORIZON, rng.poisson(number(spec, "rate") * self.HORIZON)))

    def strength(self, now: Instant, supply: Array) -> float:
        last = np.searchsorted(self.starts, now.t) - 1
        return 1 - self.share if last >= 0 and now.t - self.starts[last] < self.length else 1.0


def swinging_mass(robot: Description, spec: EffectSpec) -> Description:
    """A pendulum on a link, hardly damped."""
    mass, length = number(spec, "mass"), number(spec, "length")
    swing = SeriesJoint("swinging_mass/pivot", np.array([0.0, 1, 0]), np.inf, 0.0, 2e-5)
    (where,) = spec.where
    bob = LinkPart("swinging_mass", mass, np.array([0.0, 0, -length]), mass * 1e-4 * np.eye(3), (), joint="swinging_mass",
                   parent=where, p=vector(spec, "position"), series=(swing,))
    return replace(robot, links=(*robot.links, bob))


def floor_step(around: Surroundings, spec: EffectSpec) -> Surroundings:
    """A sheet on the floor, with its edge across the robot's way."""
    return replace(around, step=(number(spec, "x"), number(spec, "height")))


OUTSIDE_STEP: dict[str, Callable[[Columns, int, EffectSpec, np.random.Generator], StepEffect]] = {
    "gear_ripple": GearRipple, "sensor_ripple": SensorRipple, "taut_cable": TautCable, "warming_friction": WarmingFriction,
    "friction_memory": FrictionMemory, "one_way_friction": OneWayFriction, "power_dips": PowerDips,
}
OUTSIDE_ROBOT: dict[str, Build] = {"swinging_mass": swinging_mass}
OUTSIDE_AROUND: dict[str, Around] = {"floor_step": floor_step}
