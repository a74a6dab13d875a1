"""The effects that can be hidden, where, and how large: from just noticeable to plainly wrong, never absurd."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studies.concealed_effects.robots import Robot
from studies.other_engine.hidden import OUTSIDE, VOCABULARY
from workbench.robot import EffectSpec

Rng = np.random.Generator
Value = float | tuple[float, float, float]
LEGS = ("bl", "br", "fl", "fr")


@dataclass(frozen=True)
class Range:
    """A size: between low and high, evenly in its logarithm, where `either_sign` of either sign."""

    low: float
    high: float
    either_sign: bool = False

    def at(self, share: float, sign: float = 1.0) -> float:
        """The size at a share 0 to 1 of the range."""
        value = float(self.low * (self.high / self.low) ** share)
        return value * sign if self.either_sign else value


@dataclass(frozen=True)
class Entry:
    """One effect. size: the parameter that says how much of it there is, and its range. others: its further parameters, from a
    generator, the robot and the place. place: from a generator and the robot; nothing for the whole robot.
    logged: whether a robot that logs its joints can show it; walkers can show all."""

    parameter: str
    size: Range
    place: Callable[[Rng, Robot], tuple[str, ...]]
    others: Callable[[Rng, Robot, tuple[str, ...]], Mapping[str, Value]] = lambda rng, robot, where: {}
    logged: bool = True


def _whole(rng: Rng, robot: Robot) -> tuple[str, ...]:
    return ()


def _joint(rng: Rng, robot: Robot) -> tuple[str, ...]:
    if robot.kind == "rig":
        return ("swing",)
    if robot.kind == "arm":
        return (str(rng.choice(["elbow", "shoulder"])),)
    return (str(rng.choice(LEGS)) + str(rng.choice(["b", "m", "t"], p=[0.45, 0.4, 0.15])),)


def _knee_or_hip(rng: Rng, robot: Robot) -> tuple[str, ...]:
    return (str(rng.choice(LEGS)) + str(rng.choice(["b", "m"])),) if robot.rigid_bodies else _joint(rng, robot)


def _foot(rng: Rng, robot: Robot) -> tuple[str, ...]:
    return (str(rng.choice(LEGS)) + "b",)


def _thigh(rng: Rng, robot: Robot) -> tuple[str, ...]:
    return (str(rng.choice(LEGS)) + "m_link",)


def _trunk(rng: Rng, robot: Robot) -> tuple[str, ...]:
    return (str(rng.choice(["body_link", "tail_link"], p=[0.75, 0.25])),)


def _loaded(rng: Rng, robot: Robot) -> tuple[str, ...]:
    return {"rig": ("rod",), "arm": ("hand",)}.get(robot.kind) or _trunk(rng, robot)


def _asset(rng: Rng, robot: Robot) -> tuple[str, ...]:
    return (str(rng.choice([a for a in sorted(robot.rigid_bodies) if a != "body"])),)


def _spread(*size: float) -> Callable[[Rng, Robot, tuple[str, ...]], Mapping[str, Value]]:
    """A point of a link, within `size` [m] of its frame's origin."""
    def others(rng: Rng, robot: Robot, where: tuple[str, ...]) -> Mapping[str, Value]:
        if robot.kind in ("arm", "rig"):  # at the end of the last link, where a load hangs
            return {"position": (0.05, 0.0, 0.0) if robot.kind == "arm" else (0.0, 0.0, -0.1)}
        return {"position": _three(rng.uniform(-1, 1, 3) * size)}
    return others


def _stop(rng: Rng, robot: Robot, where: tuple[str, ...]) -> Mapping[str, Value]:
    return {"lower": -90.0}


def _also(**ranges: tuple[float, float]) -> Callable[[Rng, Robot, tuple[str, ...]], Mapping[str, Value]]:
    """Further parameters, each evenly from its range."""
    return lambda rng, robot, where: {k: float(f"{rng.uniform(*r):.3g}") for k, r in ranges.items()}


def _slack(rng: Rng, robot: Robot, where: tuple[str, ...]) -> Mapping[str, Value]:
    return {"from": round(float(rng.choice([-1, 1]) * rng.uniform(5, 15)), 1)}


def _swing(rng: Rng, robot: Robot, where: tuple[str, ...]) -> Mapping[str, Value]:
    return {"length": round(float(rng.uniform(0.05, 0.1)), 3), "position": (0.0, 0.0, -0.02)}


def _body(rng: Rng, robot: Robot) -> tuple[str, ...]:
    return ("body_link",)


def _sideways(rng: Rng, robot: Robot, where: tuple[str, ...]) -> Mapping[str, Value]:
    """An axis across the servo's: x or z for a joint about y, y or z for one about x."""
    across = ["y", "z"] if where[0].endswith("t") else ["x", "z"]
    return {"axis": {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}[str(rng.choice(across))]}


def _three(v: object) -> tuple[float, float, float]:
    x, y, z = np.asarray(v, dtype=float)
    return round(float(x), 4), round(float(y), 4), round(float(z), 4)


CATALOGUE: dict[str, Entry] = {
    "backlash": Entry("gap", Range(1.5, 5.0), _knee_or_hip, logged=False),
    "joint_compliance": Entry("stiffness", Range(2.0, 12.0), _knee_or_hip, logged=False),
    "coulomb_friction": Entry("torque", Range(0.06, 0.2), _joint),
    "viscous_friction": Entry("coefficient", Range(0.05, 0.25), _joint),
    "stribeck_friction": Entry("torque", Range(0.08, 0.25), _knee_or_hip, _also(speed=(8, 40))),
    "load_friction": Entry("coefficient", Range(0.25, 0.8), _knee_or_hip),
    "friction_asymmetry": Entry("ratio", Range(2.0, 5.0), _knee_or_hip),
    "supply_voltage": Entry("voltage", Range(0.65, 0.88), _whole),  # a share of the nominal supply
    "supply_sag": Entry("drop", Range(0.25, 0.9), _whole, logged=False),
    "torque_ceiling": Entry("torque", Range(0.12, 0.4), _knee_or_hip),
    "torque_saturation": Entry("torque", Range(0.15, 0.8), _knee_or_hip),
    "thermal_fade": Entry("rate", Range(0.02, 0.1), _whole),
    "servo_gain": Entry("ratio", Range(0.35, 0.75), _joint),
    "dead_band": Entry("margin", Range(0.8, 3.0), _joint),
    "reflected_inertia": Entry("inertia", Range(0.003, 0.012), _joint),
    "joint_stop": Entry("upper", Range(6.0, 30.0), _knee_or_hip, _stop),
    "zero_offset": Entry("angle", Range(3.0, 9.0, True), _knee_or_hip),
    "parallel_spring": Entry("stiffness", Range(0.2, 0.9), _joint),
    "command_delay": Entry("delay", Range(0.012, 0.05), _joint),
    "timing_drift": Entry("per_pose", Range(0.002, 0.009), _whole, logged=False),
    "clock_rate": Entry("ratio", Range(1.004, 1.03), _whole, logged=False),
    "dropped_command": Entry("probability", Range(0.06, 0.2), _knee_or_hip, logged=False),
    "speed_order": Entry("", Range(1.0, 1.0), _whole, logged=False),
    "loose_mount": Entry("play", Range(2.0, 6.0), _joint, _sideways, logged=False),
    "link_length": Entry("change", Range(0.003, 0.009, True), _thigh, logged=False),
    "payload": Entry("mass", Range(0.08, 0.35), _loaded, _spread(0.03, 0.03, 0.04)),
    "com_shift": Entry("offset", Range(0.012, 0.035), _trunk, logged=False),
    "ground_friction": Entry("friction", Range(0.12, 0.4), _whole, logged=False),
    "foot_friction": Entry("friction", Range(0.05, 0.3), _foot, logged=False),
    "ground_tilt": Entry("forward", Range(1.0, 4.0, True), _whole, _also(left=(-2, 2)), logged=False),
    "soft_ground": Entry("stiffness", Range(1.5e3, 6e3), _whole, logged=False),
    "tether_force": Entry("force", Range(0.3, 1.5), _whole, logged=False),
    "marker_frame": Entry("rotation", Range(2.0, 9.0), _asset, logged=False),
    "gear_ripple": Entry("torque", Range(0.12, 0.3), _knee_or_hip, _also(period=(8, 25))),
    "sensor_ripple": Entry("amplitude", Range(1.2, 3.0), _knee_or_hip, _also(period=(25, 60)),
                           logged=False),
    "taut_cable": Entry("stiffness", Range(0.6, 2.5), _knee_or_hip, _slack),
    "warming_friction": Entry("torque", Range(0.15, 0.3), _knee_or_hip, _also(share=(0.9, 0.9), heat=(0.3, 0.9))),
    "friction_memory": Entry("torque", Range(0.15, 0.3), _knee_or_hip,
                             _also(speed=(15, 40), time=(0.08, 0.25))),
    "one_way_friction": Entry("torque", Range(0.12, 0.25), _knee_or_hip),
    "power_dips": Entry("share", Range(0.6, 0.9), _whole, _also(length=(0.08, 0.2), rate=(0.7, 0.7))),
    "swinging_mass": Entry("mass", Range(0.06, 0.15), _body, _swing, logged=False),
    "floor_step": Entry("height", Range(0.003, 0.007), _whole, _also(x=(0.085, 0.12)), logged=False),
}
OF_THE_LAW = {"goal_ramp", "command_filter", "damping_gain", "minimum_duty"}
"""Never hidden: the trial's robots have AX-12A, which do none of it, or servos of which nothing is known."""
HIDEABLE = tuple(e for e in VOCABULARY if e not in OF_THE_LAW)
assert set(CATALOGUE) == {*HIDEABLE, *OUTSIDE}
PULLS = ("ground_friction", "foot_friction", "tether_force", "ground_tilt", "servo_gain", "payload", "com_shift", "zero_offset",
         "link_length", "parallel_spring", "supply_voltage", "torque_ceiling", "dead_band", "backlash", "joint_compliance",
         "coulomb_friction")
"""Effects that can pull the body's path either way, with which another may be masked."""
DIRECTED = ("com_shift", "tether_force", "marker_frame")
"""Effects whose size is a vector's length."""
TIES = frozenset(frozenset(pair) for pair in (
    ("timing_drift", "clock_rate"), ("supply_voltage", "thermal_fade"), ("ground_tilt", "tether_force")))
"""Pairs of the whole robot that the contract calls inseparable: where both were hidden, no second name could be asked for. Its
other pairs are inseparable at one place only, and no place gets two effects."""
MOVES = ("supply_sag", "joint_stop", "reflected_inertia", "dropped_command", "command_delay", "viscous_friction")
"""Others that change the way walked by enough to need a mask."""


@dataclass(frozen=True)
class Draw:
    """An effect of which all is drawn but its size: `at` a share 0 to 1 of its range. supply: the servos' nominal one [V]."""

    effect: str
    where: tuple[str, ...]
    others: Mapping[str, Value]
    sign: float
    direction: tuple[float, float, float]
    supply: float

    @property
    def has_sign(self) -> bool:
        """Whether it can as well pull the other way."""
        return CATALOGUE[self.effect].size.either_sign or self.effect in DIRECTED

    def flipped(self) -> Draw:
        """The same the other way."""
        return replace(self, sign=-self.sign, direction=_three(-np.array(self.direction)))

    def at(self, share: float) -> EffectSpec:
        """The effect at a size, rounded as a person would say it."""
        entry = CATALOGUE[self.effect]
        if not entry.parameter:
            return EffectSpec(self.effect, self.where, {})
        size = entry.size.at(share, self.sign)
        value: Value = float(f"{size:.4g}")
        if self.effect == "supply_voltage":
            value = round(size * self.supply, 3)
        if self.effect in DIRECTED:
            value = _three(size * np.array(self.direction))
        return EffectSpec(self.effect, self.where, {entry.parameter: value, **self.others})


def draw(effect: str, rng: Rng, robot: Robot) -> Draw:
    """Place, direction and further parameters of an effect."""
    entry = CATALOGUE[effect]
    where = entry.place(rng, robot)
    direction = rng.standard_normal(3) * (1, 1, 0 if effect in ("tether_force", "com_shift") else 1)
    sign = float(rng.choice([-1, 1]))
    direction /= np.linalg.norm(direction)
    return Draw(effect, where, entry.others(rng, robot, where), sign, _three(direction), robot.servo.supply_voltage)


def possible(robot: Robot, outside: bool) -> list[str]:
    """Effects that this robot can show, in or outside the vocabulary."""
    logs = not robot.rigid_bodies
    names = OUTSIDE if outside else HIDEABLE
    return [e for e in names if CATALOGUE[e].logged or not logs]


def crowded(robot: Robot, effects: Sequence[str]) -> bool:
    """Whether more of the effects sit in a joint than the robot has joints: none gets two."""
    return sum(CATALOGUE[e].place in (_joint, _knee_or_hip) for e in effects) > {"rig": 1, "arm": 2}.get(robot.kind, len(effects))
