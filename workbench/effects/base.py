"""The base class of effects. An effect is a piece of physics beyond the nominal model, with hooks for everything it may change.

An effect is one file with one subclass of Effect and its instance EFFECT. It has no state: all state is in EffectSpec. A station
calls the hooks for the description (SDF), law (servo constants), servo terms, ground, gravity and forces; a run calls the hook
for the commands, and a comparison the one for the measurement. Other packages add effects through entry points in the group
"workbench.effects" that name an Effect instance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from workbench.effects.registers import Registers
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording.recording import Measurement
from workbench.robot import EffectSpec, Ground, RobotModel
from workbench.servo import ServoLaw, ServoTerm
from workbench.types import Array, Mask

if TYPE_CHECKING:
    from workbench.effects.sdf import SdfRobot
    from workbench.recording.servo_log.duty_register import RegisterLaw
    from workbench.robot import ServoConstants

Place = Literal["joint", "foot", "link", "rigid_body", "robot"]
Layer = Literal["timing", "actuator", "structure", "inertia", "ground", "measurement"]
Value = float | tuple[float, float, float]
Family = Literal["electrical", "friction", "timing", "mass", "ground pull"]
"""Groups of effects with almost the same response: the family may be certain even if none of its members is."""
Tie = Literal["gravity against torque", "less torque at full duty"]
"""Effects that servo logs cannot separate. Scaling all torques and inertias together does not change the angles, so only the
ratio of gravity to torque is known; and a limit, saturation or supply sag at high duty all reduce the torque in the same way."""
Estimator = Literal["end of travel", "play across the axis", "turn of an asset at rest", "missed poses", "length between axes",
                    "turn about an axis"]
"""Ways to estimate an effect directly from the recordings (workbench/identify/estimators)."""

DEGREE = math.pi / 180
REACH = 2.0
"""Values beyond this multiple of the 99th percentile (`seldom_beyond`) are implausible."""
NEAR, BEYOND = 0.08, 0.8
"""NEAR: fraction of the nominal value by which the typical value has to be lower; BEYOND: otherwise, this fraction of the
nominal value is used instead."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect, in the unit of docs/formats.md; multiply by `si` for SI.

    low, high: physically possible range. typical: size from which it is noticeable on a small robot; fits start there and
    screening uses it as its step. vector: three numbers. shapes: it affects only the shape of the effect (for example the speed
    at which friction decays); its typical value is then neutral. replaces: it replaces a value of the nominal robot, which is
    then neutral. resolution: smallest standard deviation that any recording can give, because models are uncertain by that much.
    option: name of the optional part of the effect to which it belongs; empty: it is always given. seldom_beyond: value that one
    in a hundred servos (or robots) with the effect exceeds (for a vector, its length), with the reason in a comment; priors and
    reach follow from it. logarithmic: a ratio whose size is its logarithm, so that 2 and 1/2 are equally large. adds_to: constant
    of the servo (number of `ServoConstants`, in SI) to which it is added, and which it can take away (`Effect.lowest`).
    """

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
    adds_to: str = ""

    def typical_beside(self, neutral: float) -> float:
        """The typical value. If it replaces a nominal value, it is lower than usual (a weak supply, a slippery floor); if the
        nominal value is close to it or below it, a value below nominal is used instead, since the step would be too small."""
        near = self.replaces and self.typical > (1 - NEAR) * neutral
        return BEYOND * neutral if near else self.typical

    def distance(self, value: float, neutral: float) -> float:
        """Distance of a value from neutral; for a ratio, the absolute value of its logarithm."""
        return abs(math.log(value / neutral)) if self.logarithmic else abs(value - neutral)


class Effect:
    """Base class of effects; hooks do nothing unless overridden. `values` are in SI, by parameter name.

    An effect must define name, layer, places, parameters and `sentence`. The search does not refer to effects by name; the class
    variables from `under_load` on, `as_other`, `could_act` and `reach` describe an effect to it.
    """

    name: ClassVar[str]
    layer: ClassVar[Layer]
    places: ClassVar[tuple[Place, ...]]
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    title: ClassVar[str] = ""
    """Readable name; default: the name with spaces for underscores."""
    family: ClassVar[Family | None] = None
    """The family of effects with which it is easily confused, if any."""
    under_load: ClassVar[bool] = False
    """Whether it is observable only where joints carry load: with hanging legs, on a stand, an effect seen in a walk may not
    show."""
    needs_steady_load: ClassVar[bool] = False
    """Whether a servo log distinguishes it from inertia and friction only if gravity loads the joint."""
    observable_when_fixed: ClassVar[bool] = True
    """Whether a robot whose base is held can show it; false for effects between floor and feet."""
    hidden_by_zeroing: ClassVar[bool] = False
    """Whether it does not appear in the angles of its own joint if these are zeroed in neutral, but only through gravity and
    ground."""
    like_a_late_start: ClassVar[bool] = False
    """Whether, acting on all joints, it looks like a later first command; only a known starting time separates the two."""
    reduces_to: ClassVar[str] = ""
    """The nested effect, with no more parameters, to which it reduces at the limit of a parameter that only shapes it or, without
    such a parameter, when it is small."""
    equivalent_to: ClassVar[tuple[str, ...]] = ()
    """Observationally equivalent effects: no walk separates it from them, as their motions differ by less than those of two
    simulators."""
    includes: ClassVar[tuple[str, ...]] = ()
    """Effects at the same joint or link that are special cases of it, and are therefore never combined with it."""
    tied: ClassVar[Tie | None] = None
    """The tie whose members cannot be distinguished from a servo's own angles; a joint gets at most one of them."""
    resembles: ClassVar[Tie | None] = None
    """A tie whose effects it resembles without being a member (a joint may have both): if it or one of them is found, all are
    compared."""
    steady_pull: ClassVar[bool] = False
    """Whether it is a constant force on the robot: of several such effects, all but one only compensate for that one's imperfect
    fit."""
    point_mass: ClassVar[bool] = False
    """Whether its parameters are a mass and its position on a link, which are fitted as mass and first moments."""
    moves_center: ClassVar[bool] = False
    """Whether it only moves a link's centre of mass, which tips the robot by the same amount wherever that link is."""
    moves_feet: ClassVar[bool] = False
    """Whether it moves the feet relative to the body, which resembles a displaced centre of mass."""
    free_play: ClassVar[str] = ""
    """The parameter with the angle by which a link turns freely relative to its servo, if it does [rad in SI]."""
    estimator: ClassVar[Estimator | None] = None
    """How it is estimated directly from the recordings, without a search, if it is. Parameters: for "end of travel" the lower
    and the upper end, for "play across the axis" the play and its axis, for "turn of an asset at rest" a rotation vector,
    otherwise one number."""
    from_neutral: ClassVar[bool] = True
    """Whether a search from neutral can find it. If not, it needs an estimator: a stop has no effect until the joint reaches it,
    and for a loose mount the axis has to be known first."""

    def sentence(self, spec: EffectSpec) -> str:
        """One readable sentence that describes how this robot differs from nominal."""
        raise NotImplementedError

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        """The values, in the units of docs/formats.md, at which the effect vanishes: infinity for a stiffness or a ceiling, the
        typical value for a parameter that only shapes the effect, the robot's own for one that replaces it."""
        return (0.0,) * sum(3 if p.vector else 1 for p in self.parameters)

    def lowest(self, model: RobotModel, where: tuple[str, ...]) -> tuple[float, ...]:
        """The smallest possible value of each parameter at these places, in the units of docs/formats.md: `Parameter.low`, less
        the constant to which it is added, with the model's own effects of this name; the smallest of several joints."""
        own = [e for e in model.effects if e.effect == self.name]

        def constant(p: Parameter, joint: str) -> float:
            added = (e.parameters.get(p.name, 0.0) for e in own if joint in (e.where or model.joints))
            return float(getattr(model.servo(joint), p.adds_to)) / p.si + sum(v for v in added if not isinstance(v, tuple))

        return tuple(p.low - (min(constant(p, joint) for joint in where or model.joints) if p.adds_to else 0.0)
                     for p in self.parameters)

    def as_other(self, name: str, spec: EffectSpec, model: RobotModel) -> tuple[float, ...]:
        """The values at which the effect `name` (`reduces_to`, or one of `equivalent_to`) acts nearly the same way at the same
        joint or link, in the units of docs/formats.md; empty if unknown."""
        return ()

    def could_act(self, model: RobotModel, sent: Sequence[Commands]) -> bool:
        """Whether it could be observed at all on this robot playing these commands."""
        return True

    def reach(self, sdf: SdfRobot, model: RobotModel, where: tuple[str, ...]) -> float:
        """Largest plausible distance of its parameters from neutral on this robot (`Parameter.distance`; for a vector its
        length), in the units of docs/formats.md. A search moves no parameter further and, for servo logs, rejects the effect if
        a parameter would go beyond. REACH times `seldom_beyond` if all parameters define it; unlimited for an effect that
        vanishes at infinity."""
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
        """Changes servo constants of the joints in `columns`."""
        return law

    def servo_term(self, here: Mask, values: Mapping[str, float]) -> ServoTerm | None:
        """Behaviour of servos beyond constants; here (n,): the servos named in `where`. None: nothing."""
        return None

    def ground(self, ground: Ground, values: Mapping[str, float]) -> Ground:
        """Changes the floor."""
        return ground

    def foot_friction(self, values: Mapping[str, float]) -> float | None:
        """Friction coefficient between foot and ground, for the feet named in `where`; None: unchanged."""
        return None

    def foot_stiffness(self, values: Mapping[str, float]) -> float | None:
        """Stiffness [N/m] of each contact point on the ground; None: unchanged."""
        return None

    def zero(self, values: Mapping[str, float]) -> float:
        """Link angle minus servo angle [rad] of the joints named in `where`."""
        return 0.0

    def gravity(self, gravity: Array, values: Mapping[str, float]) -> Array:
        """Changes gravity (3,) [m/s^2] in the floor's frame."""
        return gravity

    def tether(self, values: Mapping[str, float]) -> Array | None:
        """Force (3,) [N] on the base link's origin in W; None: none."""
        return None

    def commands(self, commands: Commands, where: tuple[str, ...], values: Mapping[str, float], model: RobotModel) -> Commands:
        """Changes the commands that reach the servos, or their times."""
        return commands

    def measurement(self, measurement: Measurement, spec: EffectSpec) -> Measurement:
        """Changes how the robot is observed."""
        return measurement

    def in_registers(self, logs: Sequence[Registers], where: tuple[str, ...]) -> tuple[float, float] | None:
        """Its first parameter, in the unit of docs/formats.md, as the servos' registers show it, and its error; None: unknown."""
        return None

    def in_duty(self, law: RegisterLaw, servo: ServoConstants) -> tuple[float, float] | None:
        """The same, from the law behind the duty in one joint's logs; the error includes what is unknown of the nominal servo."""
        return None


def scalar(spec: EffectSpec, name: str) -> float:
    """A parameter that is one number, in the unit of docs/formats.md."""
    value = spec.parameters[name]
    assert not isinstance(value, tuple)
    return value


def si_values(effect: Effect, spec: EffectSpec, lowest: Sequence[float] = ()) -> dict[str, float]:
    """Scalar parameters of a spec in SI; parameters of omitted optional parts have their neutral value. lowest: by parameter, of
    `Effect.lowest`; empty: `Parameter.low`. InputError names a parameter that is missing, unknown, or out of range."""
    out: dict[str, float] = {}
    for p, low in zip(effect.parameters, lowest or [p.low for p in effect.parameters], strict=True):
        if p.name not in spec.parameters:
            if p.option:
                out[p.name] = (p.typical if p.shapes else 0.0) * p.si
                continue
            raise InputError(None, f"effect '{spec.effect}': parameter '{p.name}' [{p.unit}] is missing")
        value = spec.parameters[p.name]
        if p.vector != isinstance(value, tuple):
            wanted = "three numbers" if p.vector else "one number"
            raise InputError(None, f"effect '{spec.effect}': '{p.name}': expected {wanted}")
        for v in value if isinstance(value, tuple) else (value,):
            if not low <= v <= p.high and not math.isclose(v, low):  # which was computed in other units
                raise InputError(None, f"effect '{spec.effect}': '{p.name}' is {v:g} {p.unit}; expected {low:g} to {p.high:g}")
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
    """Raises InputError unless `where` names parts of the model on which the effect can act."""
    k = model.kinematics
    known: dict[str, tuple[str, ...]] = {
        "joint": model.joints, "foot": tuple(model.foot_links), "link": k.links, "rigid_body": tuple(model.rigid_bodies),
        "robot": ()}
    if not spec.where:
        if "robot" not in effect.places:
            raise InputError(None, f"effect '{spec.effect}': where: is empty; expected a {' or '.join(effect.places)}")
        return
    allowed = {name for place in effect.places for name in known[place]}
    for name in spec.where:
        if name not in allowed:
            places = [place.replace("_", " ") for place in effect.places if place != "robot"]
            wanted = f"is not a {' or '.join(places)} of this robot" if places else "is given, but it acts on the whole robot"
            raise InputError(None, f"effect '{spec.effect}': where: '{name}' {wanted}")
