"""Effects checked against the servos' own measurements: a register of voltage that never sags refutes a sag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from workbench.compare.session_takes import ReadTake
from workbench.effects.registers import Registers
from workbench.identify.estimators.registers import Readings
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.parameters import Candidate
from workbench.identify.results.findings import Rejected
from workbench.identify.results.reasons import RefutedByRegister


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
