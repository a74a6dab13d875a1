"""The base class of effects: one piece of physics beyond the nominal model, with hooks for everything it may change.

An effect is one file with one subclass of Effect and its instance EFFECT. It has no state: all state is in EffectSpec. A station
calls the hooks for the description (SDF), law (servo constants), servo terms, ground, gravity and forces, a run that for the
commands, a comparison that for the measurement. Another package adds effects through entry points in the group
"workbench.effects" that name an Effect instance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording.recording import Measurement
from workbench.robot import EffectSpec, Ground, RobotModel
from workbench.servo import ServoLaw, ServoTerm
from workbench.types import Array, Mask

if TYPE_CHECKING:
    from workbench.effects.sdf import SdfRobot

Place = Literal["joint", "foot", "link", "rigid_body", "robot"]
Layer = Literal["timing", "actuator", "structure", "inertia", "ground", "measurement"]
Value = float | tuple[float, float, float]
Family = Literal["electrical", "friction", "timing", "mass", "ground pull"]
"""Effects that act almost alike until data separate them: if no member is certain, the family may be."""
Tie = Literal["gravity against torque", "less torque at full duty"]
"""Effects that servo logs cannot separate. Scaling all torques and inertias together does not change the angles, so that only the
ratio of gravity to torque is known; and a torque that saturates, bends or sags with duty has the same effect."""
Estimator = Literal["end of travel", "play across the axis", "turn of an asset at rest", "missed poses", "length between axes",
                    "turn about an axis"]
"""Ways to estimate an effect directly from the recordings (workbench/identify/estimators)."""

DEGREE = math.pi / 180
REACH = 2.0
"""Values beyond this multiple of the one that one in a hundred exceeds are implausible."""
NEAR, BEYOND = 0.08, 0.8
"""Shares of the robot's own value by which the typical one has to be less, and the one taken instead."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect, in the unit of docs/formats.md; multiply by `si` for SI. low, high: physically possible range.
    typical: size from which it is noticeable on a small robot; fits start there and screening uses it as its step. vector: three
    numbers. shapes: it only shapes the effect (the speed at which friction fades), neutral being its typical value. replaces: it
    replaces a value of the nominal robot, which is then neutral. resolution: least standard deviation that any recording can
    give, since every model leaves that much open. option: name of the optional part of the effect to which it belongs; empty: it
    is always given. seldom_beyond: value that one in a hundred servos (or robots) with the effect exceeds, for a vector its
    length, with the reason in a comment; priors and reach follow from it. logarithmic: a ratio whose size is its logarithm, so
    that 2 and 1/2 are equally large."""

    name: str
    unit: str
    low: float
    high: float
    typical: float
    si: float = 1.0
    vector: bool = False
    shapes: bool = False
    replaces: bool = False
    resolution: float = 0.0
    option: str = ""
    seldom_beyond: float = math.nan
    logarithmic: bool = False

    def typical_beside(self, neutral: float) -> float:
        """The typical value, which is less than usual where it replaces the robot's own (a weak supply, a slippery floor); where
        that is so near, or less, that the step between them would show nothing of this, one beyond."""
        near = self.replaces and self.typical > (1 - NEAR) * neutral
        return BEYOND * neutral if near else self.typical

    def distance(self, value: float, neutral: float) -> float:
        """Distance of a value from neutral; for a ratio, the absolute value of its logarithm."""
        return abs(math.log(value / neutral)) if self.logarithmic else abs(value - neutral)


@dataclass(frozen=True)
class Registers:
    """Readings of the servos' own registers in one log, NaN where there are none. duty, nominal_duty: by joint, (N,), duty of the
    servo's H-bridge, and of the nominal law at the logged error, before it is limited to 1. voltage (N,) [V], None where it was
    not logged."""

    duty: Mapping[str, Array]
    nominal_duty: Mapping[str, Array]
    voltage: Array | None = None


class Effect:
    """Base class of effects; hooks do nothing unless overridden. `values` are in SI, by parameter name.

    An effect must define name, layer, places, parameters and `sentence`. It may describe itself to the search, which knows
    no effect by its name: the class variables from `under_load` on, `as_other`, `could_act` and `reach`.
    """

    name: ClassVar[str]
    layer: ClassVar[Layer]
    places: ClassVar[tuple[Place, ...]]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    title: ClassVar[str] = ""
    """Readable name, if it is not the name with spaces for underscores."""
    family: ClassVar[Family | None] = None
    """The family of effects with which it is easily confused; None: it has no family."""
    under_load: ClassVar[bool] = False
    """Whether it is observable only where joints carry load: a stand on which the legs hang may hide an effect seen in a walk."""
    needs_steady_load: ClassVar[bool] = False
    """Whether a servo log tells it from inertia and friction only where gravity loads the joint."""
    observable_when_fixed: ClassVar[bool] = True
    """Whether a robot whose base is held can show it; not what only the floor does to feet."""
    hidden_by_zeroing: ClassVar[bool] = False
    """Whether it leaves no trace in the angles of its own joint where these are zeroed in neutral, only in what gravity and
    ground make of it."""
    like_a_late_start: ClassVar[bool] = False
    """Whether, acting on all joints, it looks like a later first command: only a known start separates the two."""
    reduces_to: ClassVar[str] = ""
    """The nested effect, of no more numbers, that it becomes: where a number that only shapes it comes to its end, or, if none
    does, where it is small."""
    equivalent_to: ClassVar[tuple[str, ...]] = ()
    """Observationally equivalent effects: no walk separates it from them, as their motions differ by less than those of two
    simulators do."""
    includes: ClassVar[tuple[str, ...]] = ()
    """Effects at the same joint or link that are special cases of it, and so are never added to it."""
    tied: ClassVar[Tie | None] = None
    """Where a servo's own angles cannot tell it from others of that tie, of which a joint is given one at most."""
    resembles: ClassVar[Tie | None] = None
    """A tie of which it is no member, as a joint may have both, but whose effects it can look like: where one of them, or it, is
    found, all are compared."""
    steady_pull: ClassVar[bool] = False
    """Whether it is a steady force on the robot: of several such effects all but one only compensate for the imperfect fit of
    that one."""
    point_mass: ClassVar[bool] = False
    """Whether its numbers are a mass and where it sits on a link, which are fitted as mass and moments."""
    moves_center: ClassVar[bool] = False
    """Whether all that it does is to move a link's centre of mass, which tips a robot as much wherever that link hangs."""
    moves_feet: ClassVar[bool] = False
    """Whether it makes feet stand elsewhere than drawn, much as a centre of mass does that lies elsewhere."""
    free_play: ClassVar[str] = ""
    """The parameter that says how far a link turns freely against its servo, if it does [rad in SI]."""
    estimator: ClassVar[Estimator | None] = None
    """How it is read off the recordings without a search, if it is. Parameters that this takes: of an end of travel the lower and
    the upper end, of play across the axis the play and its axis, of a turn of an asset a rotation vector, else one number."""
    from_neutral: ClassVar[bool] = True
    """Whether a search from neutral finds it: a stop shows nothing until the joint meets it, and of loose screws the axis has to
    be known first. If not, it needs an estimator."""

    def sentence(self, spec: EffectSpec) -> str:
        """One readable sentence: how this robot differs from nominal."""
        raise NotImplementedError

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        """The values, in the units of docs/formats.md, at which the effect vanishes: infinity for a stiffness or a ceiling, the
        typical value for a number that only shapes the effect, the robot's own for one that replaces it."""
        return (0.0,) * sum(3 if p.vector else 1 for p in self.parameters)

    def as_other(self, name: str, spec: EffectSpec, model: RobotModel) -> tuple[float, ...]:
        """The values at which the effect `name` (`reduces_to`, or of `equivalent_to`) does nearly the same at the same place, in
        the formats page's units; empty where that is not known."""
        return ()

    def could_act(self, model: RobotModel, sent: Sequence[Commands]) -> bool:
        """Whether it could be observed at all on this robot playing these commands."""
        return True

    def reach(self, sdf: SdfRobot, model: RobotModel, where: tuple[str, ...]) -> float:
        """Largest plausible distance of its parameters from neutral on this robot (`Parameter.distance`), in the units of
        docs/formats.md, for a vector its length: a search moves no parameter further, and rejects it for servo logs if it would
        go beyond. REACH times the value that one in a hundred exceeds, where all parameters define that; unlimited for an effect
        that vanishes at infinity."""
        neutral = iter(self.neutral(model))
        away = []
        for p in self.parameters:
            at = [next(neutral) for _ in range(3 if p.vector else 1)]
            if not p.shapes:
                away.append(p.distance(p.seldom_beyond, 0.0 if p.vector else at[0]))
        return REACH * max(away) if away and all(map(math.isfinite, away)) else math.inf

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        """Changes the robot's SDF."""

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        """Servo constants of the joints in `columns` changed."""
        return law

    def servo_term(self, here: Mask, values: Mapping[str, float]) -> ServoTerm | None:
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

    def in_registers(self, logs: Sequence[Registers], where: tuple[str, ...]) -> tuple[float, float] | None:
        """The effect's first parameter, in the unit of docs/formats.md, as the servos' own registers tell it, and the standard
        error; None where they do not."""
        return None


def mean_of_logs(values: Sequence[float], least: float) -> tuple[float, float] | None:
    """Mean of the logs' values, and its standard error, at least `least`; None for fewer than two logs."""
    if len(values) < 2:
        return None
    return float(np.mean(values)), max(float(np.std(values, ddof=1) / math.sqrt(len(values))), least)


def scalar(spec: EffectSpec, name: str) -> float:
    """A parameter that is one number, in the unit of docs/formats.md."""
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
    """InputError unless `where` names parts that the model has and the effect can act on."""
    k = model.kinematics
    known: dict[str, tuple[str, ...]] = {
        "joint": model.joints, "foot": tuple(model.foot_links), "link": k.links, "rigid_body": tuple(model.rigid_bodies),
        "robot": ()}
    if not spec.where:
        if "robot" not in effect.places:
            raise InputError(None, f"effect '{spec.effect}': where is empty; expected one {' or '.join(effect.places)}")
        return
    allowed = {name for place in effect.places for name in known[place]}
    for name in spec.where:
        if name not in allowed:
            places = [place.replace("_", " ") for place in effect.places if place != "robot"]
            wanted = f"is not a {' or '.join(places)} of this robot" if places else "is given, but it acts on the whole robot"
            raise InputError(None, f"effect '{spec.effect}': where: '{name}' {wanted}")
