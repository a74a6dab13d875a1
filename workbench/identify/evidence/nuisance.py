"""The nominal law as nuisance: how well its numbers are known, and the robot with them recalibrated within that."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from workbench.effects.registry import estimated_by
from workbench.identify.evidence.hypothesis import Uncertain
from workbench.identify.evidence.options import EvidenceOptions, SinceThen
from workbench.robot import EffectSpec, RobotModel, ServoConstants

ZERO = "zero"
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


def uncertain_since(model: RobotModel, joint: str, zeroed: bool, drift: SinceThen) -> list[Uncertain]:
    """The same of a robot that was diagnosed before, whose constants carry the standard deviations of that."""
    servo = model.servo(joint)
    known = {name: drift.of(name, servo.share_known(name)) for name in UNITS if name != ZERO}
    out = [Uncertain(joint, name, sd) for name, sd in known.items() if nominal_value(servo, name) > 0]
    return out if zeroed else [*out, Uncertain(joint, ZERO, drift.of(ZERO, 0.0))]


def uncertain_numbers(model: RobotModel, joint: str, zeroed: bool, sheet: float = EvidenceOptions.sheet) -> list[Uncertain]:
    """The numbers of one joint's servo that are not known exactly. zeroed: whether its angles count from rest, so that no log
    tells a zero. sheet: standard deviation of the logarithm of torque and back-EMF of which nobody says how well they are
    known."""
    servo = model.servo(joint)
    shares = {name: servo.share_known(name) for name in UNITS if name != ZERO}
    shares |= {name: sheet for name, (tolerance, keys) in OF_SHEET.items()
               if getattr(servo, tolerance) is None and not set(keys) & set(dict(servo.sd))}
    out = [Uncertain(joint, name, share) for name, share in shares.items() if share > 0 and nominal_value(servo, name) > 0]
    return out if zeroed else [*out, Uncertain(joint, ZERO, ZERO_SD)]


def recalibrated(model: RobotModel, z: Mapping[Uncertain, float]) -> RobotModel:
    """The robot with numbers z standard deviations from nominal; a zero becomes an effect `zero_offset`."""
    servos = {j: model.servo(j) for j in model.joints}
    zeros: list[EffectSpec] = []
    for number, by in z.items():
        if number.name == ZERO:
            zeros += [turned_horn(number.joint, number.sd * by)] if by else []
        else:
            servos[number.joint] = _scaled(servos[number.joint], number.name, math.exp(number.sd * by))
    return model.with_physics(servos, (*model.effects, *zeros))


def turned_horn(joint: str, angle: float) -> EffectSpec:
    """The effect that turns a joint's zero by `angle` [rad]."""
    effect, *_ = estimated_by("turn about an axis")
    (p,) = effect.parameters
    return EffectSpec(effect.name, (joint,), {p.name: angle / p.si})


def nominal_value(servo: ServoConstants, name: str) -> float:
    """One of UNITS but ZERO, as the nominal law has it."""
    return float(getattr(servo, name))


def _scaled(servo: ServoConstants, name: str, by: float) -> ServoConstants:
    if name == "torque_at_full_duty":  # the back-EMF stays
        return replace(servo, stall_torque=servo.stall_torque * by, no_load_speed=servo.no_load_speed * by)
    if name == "back_emf":
        return replace(servo, no_load_speed=servo.no_load_speed / by)
    return replace(servo, **{name: getattr(servo, name) * by})  # type: ignore[arg-type]


def with_known(model: RobotModel, sds: Mapping[Uncertain, float]) -> RobotModel:
    """The robot whose servo constants carry how well they are known now: sds, of the logarithm, by number."""
    servos = {j: model.servo(j) for j in model.joints}
    for number, sd in sds.items():
        servo = servos[number.joint]
        if number.name in OF_SHEET:
            servos[number.joint] = replace(servo, **{OF_SHEET[number.name][0]: sd})  # type: ignore[arg-type]
        elif number.name != ZERO:
            known = dict(servo.sd) | {number.name: sd * nominal_value(servo, number.name)}
            servos[number.joint] = replace(servo, sd=tuple(sorted(known.items())))
    return model.with_physics(servos, model.effects)


def as_mapping(numbers: Sequence[Uncertain], z: Iterable[float]) -> dict[Uncertain, float]:
    """Standard deviations by number."""
    return dict(zip(numbers, map(float, z), strict=True))
