"""From the journal of a playing to the joint log: goals when they were sent, positions when they were read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from workbench.device.play.journal import read_play_journal
from workbench.files import InputError
from workbench.recording.formats.joint_log import write_joint_log
from workbench.types import Array, Mask

NEAR = 0.002
"""A row holds readings within this time of it [s], moved to the row's time along the line between two readings: at 200 deg/s
with a corner in between, the error is 0.4 deg at worst."""
HOLE = 0.05
"""Between readings farther apart than this the speed is unknown [s]."""
STILL = math.radians(0.5)
"""Two readings that differ by less say where a joint was between them, as long as no goal moves it [rad]."""
LATE = 2.0
"""An answer that took so many times as long as usual, and DELAY longer, has an unknown time, as the computer stood still."""
DELAY = 0.002

FASTEST = 20.0
"""No hobby servo turns faster [rad/s]; the fastest with a profile reaches 11 without a load."""
JUMP = math.radians(2)
"""Smaller steps are never thought to be impossible [rad]: a count of noise in a very short time."""


class NothingPlayedError(InputError):
    """A journal that holds no motion."""


@dataclass
class _Content:
    joints: tuple[str, ...]
    sent: list[tuple[float, dict[str, Sequence[float]]]] = field(default_factory=list)
    read: dict[str, list[Sequence[float]]] = field(default_factory=dict)
    torque: list[tuple[float, dict[str, bool]]] = field(default_factory=list)
    doubted: dict[str, float] = field(default_factory=dict)
    """From when on a joint's readings may be another servo's."""
    rests: list[float] = field(default_factory=list)
    """When it had come to rest in neutral."""


def finish_log(journal: str | Path, log: str | Path) -> Path:
    """Writes the joint log (docs/formats.md, section 3), complete or not at all. Time zero is when it has come to rest in
    neutral.

    A row at each pose, and one for readings within 4 ms; goals and moving speeds as they were sent; positions where the
    servo was read then, else blank, and of a servo that did not answer as one does from shortly before it ended the motion.
    InputError where nothing was read.
    """
    content = _read(journal)
    if not content.sent or not all(len(content.read.get(j, ())) > 1 for j in content.joints):
        raise NothingPlayedError(journal, "no goals, or a joint that was not read twice; expected a motion that was played")
    start = _rest_begins(content)
    readings = _drop_late_readings({j: np.array(content.read[j], dtype=float) for j in content.joints})
    end = max(rows[-1, 0] for rows in readings.values())
    readings = {j: rows[rows[:, 0] < content.doubted.get(j, math.inf)] for j, rows in readings.items()}
    poses = np.array([t for t, _ in content.sent if t >= start])
    moved = poses[0] if len(poses) else end
    time = _rows(start, poses, np.concatenate([r[:, 0] for r in readings.values()]))
    channels: dict[str, Array] = {}
    for joint in content.joints:
        goals = [(t, goal[joint]) for t, goal in content.sent if joint in goal]
        at = np.searchsorted([t for t, _ in goals], time, side="right") - 1
        channels[f"goal.{joint}"] = np.array([goals[k][1][0] for k in at.tolist()])
        channels[f"speed.{joint}"] = np.array([goals[k][1][1] for k in at.tolist()])
    volts = []
    for joint in content.joints:
        rows = readings[joint]
        channels[f"position.{joint}"] = _position(time, rows[:, 0], rows[:, 1], moved)
        measured = rows[np.isfinite(rows[:, 2])]
        channels[f"temperature.{joint}"] = _slow(time, measured[:, 0], measured[:, 3])
        channels[f"enabled.{joint}"] = _torque_enabled(time, joint, content)
        volts.append(_slow(time, measured[:, 0], measured[:, 2]))
    known = np.isfinite(volts).any(axis=0)
    channels["voltage"] = np.where(known, np.nansum(volts, axis=0) / np.maximum(np.isfinite(volts).sum(axis=0), 1), np.nan)
    return write_joint_log(log, time - start, channels)


def _rows(start: float, poses: Array, read: Array) -> Array:
    """Times of the rows: the start, each pose, and the middle of readings within twice NEAR, where no pose is near."""
    fixed = np.unique(np.concatenate([[start], poses]))
    out, group = list(fixed), list[float]()
    for t in [*np.sort(read[read >= start]).tolist(), math.inf]:
        if group and t - group[0] > 2 * NEAR:
            out.append((group[0] + group[-1]) / 2)
            group = []
        k = int(np.searchsorted(fixed, t))
        if math.isfinite(t) and min(abs(t - fixed[i]) for i in (k - 1, min(k, len(fixed) - 1))) > NEAR:
            group.append(t)
    rows = np.unique(out)
    return rows[np.append(True, np.diff(rows) > 1e-5)]


def _drop_late_readings(readings: Mapping[str, Array]) -> dict[str, Array]:
    """Readings without those whose answer was so late that the question may not have gone out when it should have; the first and
    the last of a joint stay."""
    took = np.concatenate([rows[:, 4] for rows in readings.values()])
    usual = np.nanmedian(took) if np.isfinite(took).any() else 0.0
    out = {}
    for joint, rows in readings.items():
        late = rows[:, 4] > max(LATE * usual, usual + DELAY)
        late[[0, -1]] = False
        timely = rows[~late]
        out[joint] = timely[_possible(timely)]
    return out


def possible(step: float, seconds: float) -> bool:
    """Whether a joint can have turned by this step [rad] in this time."""
    return abs(step) <= max(FASTEST * seconds, JUMP)


def _possible(rows: Array) -> Mask:
    """Without single readings to and from which the joint would have had to turn faster than any servo: answers to another
    program's question, or bytes whose errors the checksum missed."""
    step, took = np.diff(rows[:, 1]), np.maximum(np.diff(rows[:, 0]), 1e-4)
    fast = np.abs(step) > np.maximum(FASTEST * took, JUMP)
    out = np.ones(len(rows), dtype=bool)
    out[1:-1] = ~(fast[:-1] & fast[1:] & (step[:-1] * step[1:] < 0))
    return out


def _position(time: Array, known: Array, values: Array, moved: float) -> Array:
    """Readings near each row; before the first pose, and where two readings agree, all rows between them as well."""
    if len(known) < 2:
        return np.full(len(time), np.nan)
    after = np.clip(np.searchsorted(known, time, side="left"), 1, len(known) - 1)
    gap = known[after] - known[after - 1]
    nearest = np.minimum(np.abs(known[after] - time), np.abs(known[after - 1] - time))
    line = np.interp(time, known, values)
    closest = np.where(np.abs(known[after] - time) < np.abs(known[after - 1] - time), values[after], values[after - 1])
    between = (time >= known[0]) & (time <= known[-1])
    near = np.where((gap <= HOLE) & between, line, closest)
    resting = between & (time <= moved) & (gap <= 2 * HOLE) & (np.abs(values[after] - values[after - 1]) < STILL)
    out = np.where(nearest <= NEAR, near, np.where(resting, line, np.nan))
    return np.asarray(out, dtype=float)


def _slow(time: Array, known: Array, values: Array) -> Array:
    """What changes slowly, on the line between two readings."""
    return np.interp(time, known, values, left=np.nan, right=np.nan) if len(known) else np.full(len(time), np.nan)


def _read(path: str | Path) -> _Content:
    entries = read_play_journal(path)
    head = next(entries)
    content = _Content(tuple(head["joints"]))
    for entry in entries:
        _take(content, entry)
    return content


def _take(content: _Content, entry: Mapping[str, Any]) -> None:
    if "goal" in entry:
        content.sent.append((entry["t"], entry["goal"]))
    elif "position" in entry:
        row = (entry["t"], entry["position"], *(entry.get(key, math.nan) for key in ("voltage", "temperature", "took")))
        content.read.setdefault(entry["joint"], []).append(row)
    elif "torque" in entry:
        content.torque.append((entry["t"], entry["torque"]))
    elif "doubted" in entry:
        content.doubted |= dict.fromkeys(entry["doubted"], entry["since"])
    elif "rest" in entry:
        content.rests.append(entry["t"])


def _rest_begins(content: _Content) -> float:
    """When the rest in neutral begins; if it never came to that, when the very first goal was sent."""
    return content.rests[0] if content.rests else content.sent[0][0]


def _torque_enabled(time: Array, joint: str, content: _Content) -> Array:
    changes = [(t, on[joint]) for t, on in content.torque if joint in on]
    at = np.searchsorted([t for t, _ in changes], time, side="right") - 1
    return np.array([float(changes[k][1]) if k >= 0 else 0.0 for k in at.tolist()])
