"""Faults of a servo log, joint by joint: corrected if the correction is certain, else excluded from the evidence."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workbench.files.problem import CorrectedProblem, name_problem
from workbench.recording.recording import Recording
from workbench.recording.servo_log.astray import without_astray
from workbench.recording.servo_log.exchanged import find_exchanged
from workbench.recording.servo_log.following import JointLog, joint_logs
from workbench.recording.servo_log.held_back import held_back
from workbench.recording.servo_log.let_go import lets_go
from workbench.recording.servo_log.no_answer import without_no_answer
from workbench.recording.servo_log.relative import relative_goals
from workbench.recording.servo_log.repeats import without_repeats
from workbench.recording.servo_log.unlike import find_rounding, none_follows, unlike
from workbench.recording.servo_log.zero_shift import zero_shifts


@dataclass(frozen=True)
class Mended:
    """recording: with certain faults corrected and unusable values blanked (NaN). lines: by joint. no_goals: joints whose goals
    are not their own, which are not examined further."""

    recording: Recording
    lines: tuple[str, ...]
    no_goals: frozenset[str]


def without_faults(recording: Recording, skipped: frozenset[str] = frozenset()) -> Mended:
    """A servo log without readings that the servo did not give, with its zeros corrected, and without the evidence of joints that
    do not have their own goals, or whose servos released them. skipped: joints that another check has already reported."""
    channels, lines = dict(recording.channels), []
    joints = [j for j in recording.joints if f"position.{j}" in channels and j not in skipped]
    coarse = set()
    for joint in joints:
        name = f"position.{joint}"
        if (text := find_rounding(channels[name])) is not None:  # whose steps look like leaps
            coarse.add(joint)
            lines.append(f"{name}: {text}")
            continue
        for read in (without_astray, without_no_answer, without_repeats):
            channels[name], texts = read(recording.time, channels[name])
            lines += [name_problem(name, text) for text in texts]
    mended = replace(recording, channels=channels)
    logs = {j: log for j, log in joint_logs(mended).items() if j in joints}
    no_goals = set()
    for joint, log in logs.items():
        if (text := relative_goals(log)) is not None:
            no_goals.add(joint)
            lines.append(CorrectedProblem(f"goal.{joint}: {text}; the joint's evidence is left out"))
    swapped = find_exchanged({j: log for j, log in logs.items() if j not in no_goals})
    no_goals |= set(swapped)
    for joint, other in swapped.items():
        back = " and the other way round" if swapped.get(other) == joint else ""
        lines.append(CorrectedProblem(f"position.{joint}: follows goal.{other}, not goal.{joint}{back}: are the columns of "
                                      f"{joint} and {other} exchanged? Its evidence is left out"))
    for joint, log in logs.items():
        if joint in no_goals:
            continue
        texts = []
        if joint not in coarse:
            log, texts = _undo_zero_shift(channels, log)
            texts += _blank_released(channels, recording, log)
        lines += texts or [f"position.{joint}: {text}" for text in list(held_back(log)) or unlike(log)]
    if not any("does not follow" in text for text in lines):
        alone = none_follows({j: log for j, log in logs.items() if j not in no_goals})
        lines += [alone] if alone else []
    for joint in no_goals:
        channels[f"position.{joint}"] = np.full(len(recording.time), np.nan)
    return Mended(replace(recording, channels=channels), tuple(lines), frozenset(no_goals))


def _undo_zero_shift(channels: dict[str, np.ndarray], log: JointLog) -> tuple[JointLog, list[str]]:
    name = f"position.{log.name}"
    off, texts = zero_shifts(log)
    if not texts:
        return log, []
    values = channels[name].copy()
    values[log.rows] -= off
    channels[name] = values
    return replace(log, position=log.position - off), [name_problem(name, text) for text in texts]


def _blank_released(channels: dict[str, np.ndarray], recording: Recording, log: JointLog) -> list[str]:
    """Blanks the positions of a joint where it does not depend on its goals, and reports that."""
    name = f"position.{log.name}"
    out = list[str]()
    for first, end in lets_go(log):
        at, to_end = int(log.rows[first]), end == len(log.rows)
        last = len(recording.time) - 1 if to_end else int(log.rows[end]) - 1
        duty = channels.get(f"duty.{log.name}")
        off = duty is not None and np.nanmax(np.abs(duty[at + 1:last + 1]), initial=0.0) < 0.02 \
            < np.nanmax(np.abs(duty[:at]), initial=0.0)
        stands = bool(np.ptp(log.position[min(first + 1, end - 1):end]) == 0)
        causes = ("its duty is 0 there: the servo let go (overload, heat, low supply)" if off else
                  "its sensor stood still, or the servo let go (overload, heat, low supply, a cable)" if stands else
                  "the servo let go (overload, heat, low supply, a cable), or its horn slips")
        values = channels[name].copy()
        values[at:last + 1] = np.nan
        channels[name] = values
        when = f"from {recording.time[at]:.3f} s (row {at + 1}) " + (
            "on" if to_end else f"to {recording.time[last]:.3f} s (row {last + 1}), where it follows again")
        out.append(CorrectedProblem(f"{name}: no longer depends on goal.{log.name} {when}: {causes}; its evidence "
                                    f"{'ends there' if to_end else 'of that time is left out'}"))
    return out
