"""How a session's servo logs were logged, found from the logs themselves before anything is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from workbench.compare.session_takes import ReadTake
from workbench.files.problem import CorrectedProblem
from workbench.recording.servo_log.duty_register import RegisterLaw, RegisterLog, law_of


def describe_logging(takes: Sequence[ReadTake], laws: Mapping[str, RegisterLaw]) -> dict[str, Any]:
    """For provenance: by take, the notes and the readings that were set aside; by joint, the servo law read from the duty
    register (laws: of `register_laws`). Empty if there is nothing to report."""
    notes = {t.spec.name: list(t.recording.notes) for t in takes if t.recording.notes}
    found: dict[str, Any] = {"logs": notes} if notes else {}
    aside = {t.spec.name: lines for t in takes if (lines := corrected_problems(t.recording.problems))}
    of_duty = {joint: str(law) for joint, law in laws.items()}
    return found | ({"duty_registers": of_duty} if of_duty else {}) | ({"set_aside": aside} if aside else {})


def corrected_problems(problems: Sequence[str]) -> list[str]:
    """The problems of a recording that report corrected readings, or readings excluded from the evidence."""
    return [text for text in problems if isinstance(text, CorrectedProblem)]


def register_laws(takes: Sequence[ReadTake]) -> dict[str, RegisterLaw]:
    """The servo law of each joint, fitted to the duty registers of its logs; joints without such a register are left out."""
    logs: dict[str, list[RegisterLog]] = {}
    for t in takes:
        channels = t.recording.channels
        for joint in t.model.joints:
            goal, position, duty = (channels.get(f"{name}.{joint}") for name in ("goal", "position", "duty"))
            gain = t.model.servo(joint).proportional_gain
            if goal is None or position is None or duty is None or gain is None:
                continue
            on = channels.get(f"enabled.{joint}", np.ones(len(t.recording.time))) != 0
            logs.setdefault(joint, []).append(RegisterLog(t.recording.time, goal, position, duty, on, gain))
    laws = {joint: law_of(of_joint) for joint, of_joint in logs.items()}
    return {joint: law for joint, law in laws.items() if law is not None}
