"""The firmware's commands for a motion table (the thesis's equations 3.1 to 3.4; docs/formats.md, section 2)."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from workbench.motion.commands import Commands
from workbench.types import Array

_DEG_PER_COUNT = 300 / 1023
_RPM_PER_TABLE_COUNT = 114 / 1023
"""Value that the conversion assumes for a count of speed."""
_SERVO_COUNT = 0.111 * 2 * np.pi / 60
"""Value that the servo uses [rad/s]."""


def read_rows(path: Path) -> tuple[tuple[str, ...], Array, Array]:
    """Joints, times (K,) [s] and angles (K, n) [deg] of a motion table."""
    with open(path, encoding="utf-8", newline="") as f:
        header, *rows = list(csv.reader(f))
    values = np.array(rows, dtype=float)
    return tuple(header[1:]), values[:, 0], values[:, 1:]


def commands_from_rows(joints: tuple[str, ...], times: Array, angles: Array, cycles: int = 1) -> Commands:
    """Commands of `cycles` cycles of poses, at times (K,) [s] and angles (K, n) [deg]; the first row is no pose."""
    goals = 512 + _round(angles[1:] / _DEG_PER_COUNT)
    dwells = _round(np.diff(times) * 1000) / 1000
    speeds = _round(np.abs(np.diff(angles, axis=0) / np.diff(times)[:, None]) / 6 / _RPM_PER_TABLE_COUNT)
    if goals.min() < 0 or goals.max() > 1023 or speeds.max() > 1023:
        raise ValueError("expected goals and speeds within 0 to 1023")
    sent = np.concatenate([[0.0], np.cumsum(np.tile(dwells, cycles))])
    poses = np.tile(np.arange(len(goals)), cycles)
    return Commands(
        times=sent[:-1], joints=joints, goals=np.deg2rad((goals - 512) * _DEG_PER_COUNT)[poses],
        speeds=(speeds * _SERVO_COUNT)[poses], enabled=np.ones((len(poses), len(joints)), dtype=bool),
        end=float(sent[-1]), poses=poses)


def _round(x: Array) -> Array:
    """Half away from zero, as C's round."""
    return np.asarray(np.copysign(np.floor(np.abs(x) + 0.5), x), dtype=float)
