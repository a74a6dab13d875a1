"""The nominal law as nuisance: how well its numbers are known, and the robot with them recalibrated within that."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from workbench.identify.evidence.hypothesis import ADDITIVE, ZERO, Uncertain, factor_of, zero_effect
from workbench.identify.evidence.options import EvidenceOptions, SinceThen
from workbench.physical import SERVO
from workbench.robot import EffectSpec, RobotModel, ServoConstants
from workbench.robot.law_covariance import LawCovariance, MotionRange
from workbench.types import Array

ZERO_SD = math.radians(1.15)
"""Of a joint's zero [rad], where a log's angles count from the servo's own: a tooth of a horn is 15 degrees, an arm is set on
it by eye."""

OF_SHEET = {"torque_at_full_duty": ("torque_tolerance", ("stall_torque", "supply_voltage")),
            "back_emf": ("back_emf_tolerance", ("no_load_speed",))}
"""Numbers that come from a data sheet, with what of servo.yaml says how well they are known: its tolerance, or standard
deviations."""
UNITS = {"torque_at_full_duty": "N m", "back_emf": "N m s/rad", "coulomb_friction": "N m", "viscous_friction": "N m s/rad",
         "reflected_inertia": "kg m^2", "goal_delay": "s", "goal_ramp": "deg/s", "minimum_duty": "1", "dead_zone": "deg",
         "command_filter": "s", "derivative_gain": "s/rad", "load_friction": "1", ZERO: "rad"}
"""The numbers of a servo that are recalibrated. Torque at full duty is what supply and motor do together, which no log tells
apart."""


def uncertain_since(model: RobotModel, joint: str, drift: SinceThen) -> list[Uncertain]:
    """The uncertain numbers of a robot that was diagnosed before: known as that diagnosis knew them, together, and as far as they
    drift.

    Torque, friction and load friction are known much better together than one by one: their difference lifts an arm. Each
    number returned moves those after it, so that all are independent (Cholesky's factor of the covariance)."""
    servo = model.servo(joint)
    names = [*(name for name in UNITS if name != ZERO and nominal_value(servo, name) > 0), ZERO]
    known = (np.diag([0.0 if name == ZERO else servo.share_known(name)**2 for name in names]) if servo.covariance is None
             else servo.covariance.among(names))
    L = np.linalg.cholesky(known + np.diag([drift.of(name)**2 for name in names]))
    return [Uncertain(joint, name, float(L[k, k]), tuple((names[i], float(L[i, k])) for i in range(k + 1, len(names)) if L[i, k]),
                      _in_si(servo, name)) for k, name in enumerate(names)]


def uncertain_numbers(model: RobotModel, joint: str, sheet: float = EvidenceOptions.sheet) -> list[Uncertain]:
    """The numbers of one joint's servo that are not known exactly. sheet: standard deviation of the logarithm of torque and
    back-EMF of which nobody says how well they are known."""
    servo = model.servo(joint)
    shares = {name: servo.share_known(name) for name in UNITS if name != ZERO}
    shares |= {name: sheet for name, (tolerance, keys) in OF_SHEET.items()
               if getattr(servo, tolerance) is None and not set(keys) & set(dict(servo.sd))}
    out = [Uncertain(joint, name, share, nominal=_in_si(servo, name)) for name, share in shares.items()
           if share > 0 and nominal_value(servo, name) > 0]
    return [*out, Uncertain(joint, ZERO, ZERO_SD, nominal=0.0)]


def recalibrate(model: RobotModel, z: Mapping[Uncertain, float]) -> RobotModel:
    """The robot with numbers z standard deviations from nominal; a zero becomes an effect `zero_offset`."""
    servos = {j: model.servo(j) for j in model.joints}
    zeros: list[EffectSpec] = []
    scales: dict[str, dict[str, float]] = {}
    for (joint, name), by in changed_by(z).items():
        if name == ZERO:
            zeros += [turned_horn(joint, by)] if by else []
        elif by:
            scales.setdefault(joint, {})[name] = float(factor_of(name, by))
    servos |= {joint: _scaled(servos[joint], tuple(by.items())) for joint, by in scales.items()}
    return model.with_physics(servos, (*model.effects, *zeros))


def changed_by(z: Mapping[Uncertain, float]) -> dict[tuple[str, str], float]:
    """How far z standard deviations move each number, by joint and name: as `Uncertain.changes`."""
    out: dict[tuple[str, str], float] = {}
    for number, by in z.items():
        for name, each in number.changes.items():
            out[number.joint, name] = out.get((number.joint, name), 0.0) + by * each
    return out


def mixing(numbers: Sequence[Uncertain]) -> Array:
    """How far each number (row), in the order of `numbers`, moves for one standard deviation of each (column), (k, k)."""
    rows = {(n.joint, n.name): i for i, n in enumerate(numbers)}
    out = np.zeros((len(numbers), len(numbers)))
    for k, n in enumerate(numbers):
        for name, by in n.changes.items():
            out[rows[n.joint, name], k] = by
    return out


def turned_horn(joint: str, angle: float) -> EffectSpec:
    """The effect that turns a joint's zero by `angle` [rad]."""
    effect = zero_effect()
    (p,) = effect.parameters
    return EffectSpec(effect.name, (joint,), {p.name: angle / p.si})


def with_whole_zeros(model: RobotModel) -> RobotModel:
    """The robot with one effect for each zero, where several (nominal, recalibrated, found) turn the same horn and their sum is
    within the effect's range."""
    zero = zero_effect()
    (p,) = zero.parameters
    out: list[EffectSpec] = []
    for e in model.effects:
        k = next((k for k, o in enumerate(out) if e.effect == zero.name and (o.effect, o.where) == (e.effect, e.where)), None)
        both = [] if k is None else [o.parameters[p.name] for o in (out[k], e)]
        whole = sum(angle for angle in both if not isinstance(angle, tuple))
        if k is not None and p.low <= whole <= p.high:
            out[k] = replace(e, parameters={p.name: whole})
        else:
            out.append(e)
    return model if len(out) == len(model.effects) else model.with_effects(out)


def nominal_value(servo: ServoConstants, name: str) -> float:
    """The nominal value of one of UNITS, ZERO apart."""
    return float(getattr(servo, name))


def _in_si(servo: ServoConstants, name: str) -> float:
    return 0.0 if name == ZERO else nominal_value(servo, name) * (math.radians(1) if UNITS[name].startswith("deg") else 1.0)


@lru_cache(maxsize=256)  # most models that are compared differ in one number of one servo
def _scaled(servo: ServoConstants, scales: tuple[tuple[str, float], ...]) -> ServoConstants:
    out = {"stall_torque": servo.stall_torque, "no_load_speed": servo.no_load_speed}
    for name, by in scales:
        if name == "torque_at_full_duty":  # the back-EMF stays
            out = {**out, "stall_torque": out["stall_torque"] * by, "no_load_speed": out["no_load_speed"] * by}
        elif name == "back_emf":
            out["no_load_speed"] /= by
        else:
            out[name] = getattr(servo, name) * by
    out = {name: min(value, SERVO[name].most) for name, value in out.items()}  # a fit may try all ends at once
    return replace(servo, **out)  # type: ignore[arg-type]


def with_known(model: RobotModel, numbers: Sequence[Uncertain], covariance: Array,
               observed: Mapping[str, MotionRange | None] | None = None) -> RobotModel:
    """The robot whose servo constants carry how well they are known now. covariance (k, k): of the numbers' z. observed: the
    motion that shows them, by joint."""
    servos = {j: model.servo(j) for j in model.joints}
    M = mixing(numbers)
    for k, n in enumerate(numbers):  # shares of what a sum is now
        if n.name in ADDITIVE and (now := nominal_value(servos[n.joint], n.name)) > 0:
            M[k] *= n.nominal / now
    C = M @ covariance @ M.T
    for joint in dict.fromkeys(n.joint for n in numbers):
        own = [k for k, n in enumerate(numbers) if n.joint == joint]
        names = [numbers[k].name for k in own]
        servo = replace(servos[joint], covariance=LawCovariance.of(names, C[np.ix_(own, own)], (observed or {}).get(joint)))
        for name, k in zip(names, own):
            sd = math.sqrt(C[k, k])
            if name in OF_SHEET:
                servo = replace(servo, **{OF_SHEET[name][0]: sd})  # type: ignore[arg-type]
            elif name != ZERO:
                servo = replace(servo, sd=tuple(sorted((dict(servo.sd) | {name: sd * nominal_value(servo, name)}).items())))
        servos[joint] = servo
    return model.with_physics(servos, model.effects)


def widen(covariance: Array, by: float) -> Array:
    """A covariance (k, k) of numbers whose variance was 1 before any data, with the data's information as if errors were `by`
    times as large. Directions of which the data hold no information keep their variance."""
    variances, axes = np.linalg.eigh(covariance)
    information = np.maximum(1.0 / np.clip(variances, 1e-12, 1.0) - 1.0, 0.0)
    return np.asarray((axes / (1.0 + information / by**2)) @ axes.T)


def as_mapping(numbers: Sequence[Uncertain], z: Iterable[float]) -> dict[Uncertain, float]:
    """Standard deviations by number."""
    return dict(zip(numbers, map(float, z), strict=True))
