"""From the journal of a playing to the joint log: goals when they were sent, positions when they were read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.device.play.journal import read_play_journal
from workbench.files import InputError
from workbench.recording.formats.joint_log import write_joint_log

Array = NDArray[np.float64]
STEP = 0.02
"""Between rows of the log [s]: as often as fifteen AX-12A can be read."""
HOLE = 4.0
"""Longest time between two readings of a servo that is bridged, in usual times between them."""


class NothingPlayedError(InputError):
    """A journal that holds no motion."""


@dataclass
class _Content:
    joints: tuple[str, ...]
    sent: list[tuple[float, dict[str, Sequence[float]]]] = field(default_factory=list)
    read: dict[str, list[Sequence[float]]] = field(default_factory=dict)
    torque: list[tuple[float, dict[str, bool]]] = field(default_factory=list)
    rests: list[float] = field(default_factory=list)
    """When it had come to rest in neutral."""


def finish_log(journal: str | Path, log: str | Path) -> Path:
    """Writes the joint log (docs/formats.md, section 3), whole or not at all. Time zero is when it has come to rest in neutral.

    A row every 20 ms and at each pose; goals and moving speeds as they were sent; positions, between two readings of a servo, on
    the line between them; duty where the servo's output is what it reports. InputError where nothing was read.
    """
    content = _read(journal)
    if not content.sent or not all(len(content.read.get(j, ())) > 1 for j in content.joints):
        raise NothingPlayedError(journal, "no goals, or a joint that was not read twice; expected a motion that was played")
    start = _rest_begins(content)
    end = max(rows[-1][0] for rows in content.read.values())
    poses = [t for t, _ in content.sent if t >= start]
    grid = np.arange(start, end, STEP)
    near = np.searchsorted(poses, grid)
    late = np.array([min((abs(poses[i] - t) for i in (k - 1, k) if 0 <= i < len(poses)), default=math.inf)
                     for k, t in zip(near.tolist(), grid.tolist())])
    time = np.unique(np.concatenate([poses, grid[late > 1e-3]]))
    channels: dict[str, Array] = {}
    for joint in content.joints:
        goals = [(t, goal[joint]) for t, goal in content.sent if joint in goal]
        at = np.searchsorted([t for t, _ in goals], time, side="right") - 1
        channels[f"goal.{joint}"] = np.array([goals[k][1][0] for k in at.tolist()])
        channels[f"speed.{joint}"] = np.array([goals[k][1][1] for k in at.tolist()])
    for joint in content.joints:
        rows = np.array(content.read[joint])
        channels[f"position.{joint}"] = _between(time, rows[:, 0], rows[:, 1])
        channels[f"temperature.{joint}"] = _between(time, rows[:, 0], rows[:, 4])
        channels[f"enabled.{joint}"] = _enabled(time, joint, content)
    volts = np.array([_between(time, np.array(r)[:, 0], np.array(r)[:, 3]) for r in content.read.values()])
    known = np.isfinite(volts).any(axis=0)
    channels["voltage"] = np.where(known, np.nansum(volts, axis=0) / np.maximum(np.isfinite(volts).sum(axis=0), 1), np.nan)
    return write_joint_log(log, time - start, channels)


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
        row = (entry["t"], entry["position"], entry["duty"], entry["voltage"], entry["temperature"])
        content.read.setdefault(entry["joint"], []).append(row)
    elif "torque" in entry:
        content.torque.append((entry["t"], entry["torque"]))
    elif "rest" in entry:
        content.rests.append(entry["t"])


def _rest_begins(content: _Content) -> float:
    """When the rest in neutral begins; where it never came to that, when the first goal of all was sent."""
    return content.rests[0] if content.rests else content.sent[0][0]


def _between(time: Array, known: Array, values: Array) -> Array:
    out = np.interp(time, known, values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(known, time, side="left"), 1, len(known) - 1)
    apart = np.diff(known)
    out[(known[after] - known[after - 1] > HOLE * np.median(apart)) & (np.abs(known[after] - time) > 1e-9)] = np.nan
    return np.asarray(out)


def _enabled(time: Array, joint: str, content: _Content) -> Array:
    changes = [(t, on[joint]) for t, on in content.torque if joint in on]
    at = np.searchsorted([t for t, _ in changes], time, side="right") - 1
    return np.array([float(changes[k][1]) if k >= 0 else 0.0 for k in at.tolist()])
