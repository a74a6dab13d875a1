"""Physics known from the servos' own registers, without simulation: those of a session (`registers`), and duty in its logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

from workbench.compare.logged import register_laws
from workbench.compare.session import Session
from workbench.compare.session_takes import ReadTake
from workbench.effects.registry import estimated_by
from workbench.identify.estimators.geometry import Measured
from workbench.identify.options import READ_OFF
from workbench.recording.servo_log.duty_register import RegisterLaw


def read_off_registers(session: Session, takes: Sequence[ReadTake]) -> tuple[Measured, ...]:
    """Effects that registers tell, one for each that is not as the nominal model has it: of the session's file of registers, else
    of the columns of duty in its logs."""
    told = _of_file(session)
    known = {(m.effect, m.where) for m in told} | {(e.effect, joint) for e in session.model.effects for joint in e.where}
    return (*told, *(m for m in gains_of_duty(register_laws(takes)) if (m.effect, m.where) not in known))


def gains_of_duty(laws: Mapping[str, RegisterLaw]) -> tuple[Measured, ...]:
    """The gains of servos whose duty is not what the nominal gain makes of the logged error. laws: by joint."""
    out = []
    for effect, (joint, law) in product(estimated_by("gain in a register of duty"), laws.items()):
        error = max(law.sd["gain"], READ_OFF.duty_law * law.gain)
        if abs(law.gain - 1.0) > READ_OFF.geometry_sure * error:
            seen = " Read from the servo's own register of duty in the logs, without any simulation."
            out.append(Measured(effect.name, joint, law.gain, error, seen))
    return tuple(out)


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
