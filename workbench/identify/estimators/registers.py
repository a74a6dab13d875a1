"""Physics known from the servos' own registers, without simulation: those of a session (`registers`), and duty in its logs; and
effects that these refute, as a register of voltage that never sags refutes a sag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from workbench.compare.session import Session
from workbench.compare.session_takes import ReadTake
from workbench.effects.base import Effect
from workbench.effects.registers import Registers
from workbench.effects.registry import known_effects
from workbench.identify.estimators.geometry import Measured
from workbench.identify.options import READ_OFF
from workbench.identify.parameters import Candidate, Key
from workbench.identify.results.findings import Rejected
from workbench.identify.results.reasons import RefutedByRegister
from workbench.recording.servo_log.duty_register import RegisterLaw
from workbench.robot import RobotModel

if TYPE_CHECKING:
    from workbench.identify.evidence.options import EvidenceOptions

Readings = Mapping[Key, tuple[float, float]]
"""First parameter and standard error of effects, by effect and place."""


def read_off_registers(session: Session, laws: Mapping[str, RegisterLaw]) -> tuple[Measured, ...]:
    """Effects identified from registers, one for each that differs from the nominal model: from the session's file of registers,
    else from the duty in its logs. laws: behind that duty, by joint."""
    told, model = _of_file(session), session.model
    known = {m.effect for m in told} | {e.effect for e in model.effects}
    return (*told, *(m for m in read_off_duty(model, laws) if m.effect not in known))


def read_off_duty(model: RobotModel, laws: Mapping[str, RegisterLaw]) -> list[Measured]:
    """Effects identified from the duty of servos, where they differ from neutral by five standard errors. laws: by joint."""
    out = []
    for (name, where), (value, error) in readings(model, laws).items():
        effect = known_effects()[name]
        p, neutral = effect.parameters[0], effect.neutral(model)[0]
        if abs(value - neutral) > READ_OFF.geometry_sure * error and effect.lowest(model, where)[0] <= value <= p.high:
            of = "the servo's register" if where else "the servos' registers"
            seen = f" Read from {of} of duty in the logs, without any simulation."
            out.append(Measured(name, where[0] if where else "", value, error, seen))
    return out


def readings(model: RobotModel, laws: Mapping[str, RegisterLaw]) -> Readings:
    """Readings of each effect that the duty of servos shows: of the whole robot where that is possible and all of its joints
    agree, else by joint."""
    out = dict[Key, tuple[float, float]]()
    for effect in known_effects().values():
        shown = {joint: r for joint, law in laws.items() if (r := effect.in_duty(law, model.servo(joint))) is not None}
        together = _together(effect, model, shown)
        if together is not None:
            out[effect.name, ()] = together
        elif "joint" in effect.places:
            out |= {(effect.name, (joint,)): r for joint, r in shown.items()}
    return out


def _together(effect: Effect, model: RobotModel, shown: Mapping[str, tuple[float, float]]) -> tuple[float, float] | None:
    """One reading of all joints; None if the effect does not act on the whole robot, or where a joint has none or another."""
    if "robot" not in effect.places or set(shown) != set(model.joints) or (len(shown) == 1 and "joint" in effect.places):
        return None
    values, errors = np.array(list(shown.values())).T
    middle = float(np.median(values))
    return None if (np.abs(values - middle) > READ_OFF.geometry_sure * errors).any() else (middle, float(errors.min()))


def _of_file(session: Session) -> list[Measured]:
    """None where the session names no file."""
    out = []
    for departure in session.registers.departures(session.model) if session.registers is not None else ():
        if departure.effect is not None:
            ((_, value),) = departure.effect.parameters.items()
            assert isinstance(value, float)
            seen = (f" Read from the servo's own register, without any recording: {departure.key} is {departure.found:g}, the "
                    f"model has {departure.nominal:g}.")
            out.append(Measured(departure.effect.effect, departure.joint, value, READ_OFF.register_exact * abs(value), seen))
    return out


def registers_of(takes: Sequence[ReadTake]) -> list[Registers]:
    """The servos' registers, log by log."""
    out = []
    for t in takes:
        channels, duty = t.recording.channels, {}
        for joint in t.model.joints:
            if (register := channels.get(f"duty.{joint}")) is not None:
                on = channels.get(f"enabled.{joint}", np.ones_like(register)) > 0.5
                duty[joint] = np.where(on, register, np.nan)
        out.append(Registers(duty, channels.get("voltage")))
    return out


def within_registers(candidates: Sequence[Candidate], takes: Sequence[ReadTake], of_duty: Readings, options: EvidenceOptions
                     ) -> tuple[list[Candidate], list[Rejected]]:
    """Candidates limited to the range allowed by the registers, and those refuted: for which even `refuted` of the
    typical size is further than `sure` standard errors from the register's value."""
    logs, kept, refuted = registers_of(takes), list[Candidate](), list[Rejected]()
    for c in candidates:
        shown = c.effect.in_registers(logs, c.where) or of_duty.get(c.key)
        if shown is None:
            kept.append(c)
            continue
        value, error = shown
        reach = abs(value - c.neutral[0]) + options.sure * error
        if reach < options.refuted * abs(c.typical[0] - c.neutral[0]):
            p = c.parameters[0]
            refuted.append(Rejected(c.name, c.where, RefutedByRegister(p.name, value, error, p.unit)))
        else:
            kept.append(replace(c, reach=reach))
    return kept, refuted
