"""The state of a servo log's robot at the first command."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.recording.recording import Recording
from workbench.recording.white_noise import white_noise
from workbench.types import Array

_FEW_STEPS = 10  # too few values to determine a count
_OFF = 0.02
"""Largest median distance of steps from whole multiples of a count, as a share of it: rounding to hundredths of it still
passes."""
_ROUNDED = 1e-6
"""Steps below are of rounding, not of an encoder [rad]: 2**20 counts a turn are six times as wide."""
_CERTAIN = 3.0
"""Standard errors above which a velocity differs from zero."""
_SPAN = 0.05
"""Span of positions from which a velocity is estimated where a log has none [s]: a servo's rise time. Their parabola is used,
since a first goal that is far away brings a servo at rest to full speed within that time."""


def first_command(recording: Recording, starts_at: float | None = None) -> float:
    """Time of a log's first command on its own clock [s]: from the session, else from the log, else its first row."""
    return float(recording.metadata.get("first command", recording.time[0])) if starts_at is None else starts_at


def resolution(values: Array) -> float:
    """The smallest step between neighbouring values (N,), one count of the sensor; 0 if nothing changes."""
    steps = np.abs(np.diff(values[np.isfinite(values)]))
    steps = steps[steps > 1e-9]
    return float(steps.min()) if len(steps) else 0.0


def staying(values: Array) -> Array:
    """Values of (N,) that repeat in the next row: whole counts, even if the log interpolates between them on a clock of its
    own."""
    values = values[np.isfinite(values)]
    return values[:-1][np.diff(values) == 0]


def count_that_stays(values: Array) -> float:
    """One count of measured values (N,), from those that stay for two rows: a log on a clock of its own may contain interpolated
    values where they change. NaN where few stay."""
    steps = np.diff(np.unique(staying(values)))
    steps = steps[steps > _ROUNDED]
    return float(steps.min()) if len(steps) >= _FEW_STEPS else float("nan")


def count_of(values: Array) -> float:
    """The number of which all steps between values (N,) are whole multiples, to _OFF of it in the median: one count of a sensor,
    more precise than `resolution` for values that were rounded when written. NaN if none is certain."""
    steps = np.diff(np.unique(values[np.isfinite(values)]))
    steps = steps[steps > 1e-3 * np.max(steps, initial=0.0)]
    if len(steps) < _FEW_STEPS:
        return float("nan")
    count = float(steps.min())
    for _ in range(3):  # from the multiples, the larger the better
        count = float(np.sum(steps) / np.sum(np.round(steps / count)))
    away = np.abs(steps / count - np.round(steps / count))
    return count if np.all(away < 5 * _OFF) and np.median(away) < _OFF else float("nan")


def state_at(recording: Recording, joints: Sequence[str], time: float) -> tuple[Array, Array] | None:
    """Angles and velocities (n,) [rad, rad/s] of the servos at `time` [s] on the log's clock; a joint whose position is not
    logged is taken to rest in neutral. None where all joints do, to within a count of position and of velocity."""
    q, v = np.zeros(len(joints)), np.zeros(len(joints))
    neutral = True
    for i, joint in enumerate(joints):
        position = recording.channels.get(f"position.{joint}")
        if position is None or not np.isfinite(position).any():
            continue
        q[i], v[i] = _at(recording.time, position, time), _velocity(recording, joint, position, time)
        speed = recording.channels.get(f"velocity.{joint}")
        count = resolution(speed) if speed is not None else resolution(position) / _SPAN
        neutral &= abs(q[i]) < 1.5 * resolution(position) and abs(v[i]) < 1.5 * count
    return None if neutral else (q, v)


def _at(time: Array, values: Array, when: float) -> float:
    known = np.isfinite(values)
    return float(np.interp(when, time[known], values[known]))


def _velocity(recording: Recording, joint: str, position: Array, time: float) -> float:
    """A joint's velocity [rad/s], as logged, else the slope of the first positions where that exceeds their noise: a robot that
    is not seen to move is at rest, and in one that is stuck in its friction an initial velocity error would move it
    permanently."""
    speed = recording.channels.get(f"velocity.{joint}")
    if speed is not None and np.isfinite(speed).any():
        return _at(recording.time, speed, time)
    known = np.isfinite(position) & (recording.time >= time - 1e-9)
    t, q = recording.time[known], position[known]
    near = t <= t[0] + _SPAN if len(t) else np.zeros(0, dtype=bool)
    if near.sum() < 3:
        return 0.0
    order = 2 if near.sum() >= 5 else 1
    fit, spread = np.polyfit(t[near] - t[0], q[near], order, cov="unscaled")
    noise = np.fmax(resolution(position) / np.sqrt(12.0), white_noise(position))  # at least that of rounding
    v, error = float(fit[order - 1]), float(noise * np.sqrt(spread[order - 1, order - 1]))
    return v if abs(v) > _CERTAIN * error else 0.0
