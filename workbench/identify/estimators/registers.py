"""Physics known from the servos' own registers (`registers` of a session) before the first step."""

from __future__ import annotations

from workbench.compare.session import Session
from workbench.identify.estimators.geometry import Measured
from workbench.identify.options import READ_OFF


def read_off_registers(session: Session) -> tuple[Measured, ...]:
    """Effects that registers tell, one for each that is not as the nominal model has it; none where the session names no file."""
    if session.registers is None:
        return ()
    out = []
    for departure in session.registers.departures(session.model):
        if departure.effect is not None:
            ((_, value),) = departure.effect.parameters.items()
            assert isinstance(value, float)
            seen = (f" Read from the servo's own register, without any recording: {departure.key} is {departure.found:g}, the "
                    f"model has {departure.nominal:g}.")
            out.append(Measured(departure.effect.effect, departure.joint, value, READ_OFF.register_exact * abs(value), seen))
    return tuple(out)
