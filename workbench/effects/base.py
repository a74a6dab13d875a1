"""What an effect is: one piece of physics beyond the nominal model, with hooks into what it changes.

An effect is one file with one subclass of Effect and its instance EFFECT. It is plain: all state is in EffectSpec. A station
asks for its description (SDF), law (servo constants), servo terms, ground, gravity and forces, a run for its commands, a
comparison for its measurement. Another package adds effects through entry points in the group "workbench.effects" that name an
Effect instance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from workbench.motion.commands import Commands
from workbench.recording.recording import Measurement
from workbench.robot import EffectSpec, Ground, InputError, RobotModel
from workbench.servo import ServoLaw, ServoTerm

if TYPE_CHECKING:
    from workbench.effects.sdf import SdfRobot

Array = NDArray[np.float64]
Place = Literal["joint", "foot", "link", "rigid_body", "robot"]
Layer = Literal["timing", "actuator", "structure", "inertia", "ground", "measurement"]
Value = float | tuple[float, float, float]

DEGREE = math.pi / 180
NEAR, BEYOND = 0.08, 0.8
"""Shares of the robot's own value by which the typical one has to be less, and the one taken instead."""


@dataclass(frozen=True)
class Parameter:
    """A number of an effect, in the contract's unit; `si` times it is SI. low, high: what is physically possible. typical: where
    it starts to be felt on a small robot; fits start there and screening uses it as its step. vector: three of them. shapes: it
    only shapes the effect (the speed at which friction fades), neutral being its typical value. replaces: it takes the place of a
    value that the nominal robot has, which is then neutral. option: name of the part of the effect that it belongs to and that
    may be left out; empty: it is always given."""

    name: str
    unit: str
    low: float
    high: float
    typical: float
    si: float = 1.0
    vector: bool = False
    shapes: bool = False
    replaces: bool = False
    option: str = ""

    def typical_beside(self, neutral: float) -> float:
        """The typical value, which is less than usual where it replaces the robot's own (a weak supply, a slippery floor); where
        that is so near, or less, that the step between them would show nothing of this, one beyond."""
        near = self.replaces and self.typical > (1 - NEAR) * neutral
        return BEYOND * neutral if near else self.typical


class Effect:
    """Base of all effects; hooks do nothing unless overridden. `values` are in SI, by parameter name."""

    name: ClassVar[str]
    layer: ClassVar[Layer]
    places: ClassVar[tuple[Place, ...]]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    under_load: ClassVar[bool] = False
    """Whether it shows only where joints carry load: a stand that lets the legs hang may hide what a walk shows."""
    limit: ClassVar[str] = ""
    """The effect, of no more numbers, that it becomes: where a number that only shapes it comes to its end, or, if none does,
    where it is small."""
    twin: ClassVar[str] = ""
    """The effect from which no walk tells it: both move the robot alike, by less apart than engines are."""
    free_play: ClassVar[str] = ""
    """The parameter that says how far a link turns freely against its servo, if it does [rad in SI]."""

    def sentence(self, spec: EffectSpec) -> str:
        """For a person: what is different about this robot."""
        raise NotImplementedError

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        """The values, in the contract's units, at which the effect vanishes: infinity for a stiffness or a ceiling, the
        typical value for a number that only shapes the effect, the robot's own for one that replaces it."""
        return (0.0,) * sum(3 if p.vector else 1 for p in self.parameters)

    def as_other(self, name: str, spec: EffectSpec, model: RobotModel) -> tuple[float, ...]:
        """The values at which the effect `name` (`limit` or `twin`) does nearly the same at the same place, in the contract's
        units; empty where that is not known."""
        return ()

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        """Changes the robot's SDF."""

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        """Servo constants of the joints in `columns` changed."""
        return law

    def servo_term(self, here: NDArray[np.bool_], values: Mapping[str, float]) -> ServoTerm | None:
        """What servos do beyond constants; here (n,): the servos named in `where`. None: nothing."""
        return None

    def ground(self, ground: Ground, values: Mapping[str, float]) -> Ground:
        """The floor changed."""
        return ground

    def foot_friction(self, values: Mapping[str, float]) -> float | None:
        """Friction of the pair foot and ground, for the feet named in `where`; None: unchanged."""
        return None

    def foot_stiffness(self, values: Mapping[str, float]) -> float | None:
        """Stiffness [N/m] of each contact point on the ground; None: unchanged."""
        return None

    def zero(self, values: Mapping[str, float]) -> float:
        """Link angle less servo angle [rad] of the joints named in `where`."""
        return 0.0

    def gravity(self, gravity: Array, values: Mapping[str, float]) -> Array:
        """Gravity (3,) [m/s^2] in the floor's frame changed."""
        return gravity

    def tether(self, values: Mapping[str, float]) -> Array | None:
        """Force (3,) [N] on the base link's origin in W; None: none."""
        return None

    def commands(self, commands: Commands, where: tuple[str, ...], values: Mapping[str, float], model: RobotModel) -> Commands:
        """What reaches the servos, and when, changed."""
        return commands

    def measurement(self, measurement: Measurement, spec: EffectSpec) -> Measurement:
        """How the robot is seen changed."""
        return measurement


def scalar(spec: EffectSpec, name: str) -> float:
    """A parameter that is one number, in the contract's unit."""
    value = spec.parameters[name]
    assert not isinstance(value, tuple)
    return value


def si_values(effect: Effect, spec: EffectSpec) -> dict[str, float]:
    """Scalar parameters of a spec in SI, those of options left out at their neutral value; InputError names one that is missing,
    unknown, or out of range."""
    out: dict[str, float] = {}
    for p in effect.parameters:
        if p.name not in spec.parameters:
            if p.option:
                out[p.name] = (p.typical if p.shapes else 0.0) * p.si
                continue
            raise InputError(None, f"effect '{spec.effect}': parameter '{p.name}' [{p.unit}] is missing")
        value = spec.parameters[p.name]
        if p.vector != isinstance(value, tuple):
            raise InputError(None, f"effect '{spec.effect}': '{p.name}' is {'three numbers' if p.vector else 'one number'}")
        for v in value if isinstance(value, tuple) else (value,):
            if not p.low <= v <= p.high:
                raise InputError(None, f"effect '{spec.effect}': '{p.name}' is {v:g} {p.unit}; expected {p.low:g} to {p.high:g}")
        if isinstance(value, tuple):
            out |= {f"{p.name}.{i}": v * p.si for i, v in enumerate(value)}
        else:
            out[p.name] = value * p.si
    unknown = set(spec.parameters) - {p.name for p in effect.parameters}
    if unknown:
        raise InputError(None, f"effect '{spec.effect}': unknown parameter '{min(unknown)}'")
    return out


def vector(values: Mapping[str, float], name: str) -> Array:
    """A parameter that is three numbers (3,), from `si_values`."""
    return np.array([values[f"{name}.{i}"] for i in range(3)])


def check_places(effect: Effect, spec: EffectSpec, model: RobotModel) -> None:
    """InputError unless `where` names what the model has and the effect can act on."""
    k = model.kinematics
    feet = tuple(j for j in model.joints if j in k.frames and not any(f.parent == k.frames[j].child for f in k.frames.values()))
    known: dict[str, tuple[str, ...]] = {
        "joint": model.joints, "foot": feet, "link": k.links, "rigid_body": tuple(model.rigid_bodies), "robot": ()}
    if not spec.where:
        if "robot" not in effect.places:
            raise InputError(None, f"effect '{spec.effect}': where is empty; expected one {' or '.join(effect.places)}")
        return
    allowed = {name for place in effect.places for name in known[place]}
    for name in spec.where:
        if name not in allowed:
            raise InputError(None, f"effect '{spec.effect}': where: '{name}' is no {' or '.join(effect.places)} of this robot")
