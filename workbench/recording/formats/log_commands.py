"""Commands that a servo log carries itself: a goal in each row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.motion.commands import Commands
from workbench.types import Array

_EPOCH = 1e8
"""Seconds since 1970 are more than that [s]."""


def out_of_order(time: Array) -> NDArray[np.bool_]:
    """Which of times (N,) [any unit] are not finite, or not later than the one before. Times are compared after the first is
    subtracted, as readers do that: a first time of -1e308 makes all the others equal."""
    with np.errstate(over="ignore", invalid="ignore"):
        since = time - time[:1]
        bad = ~np.isfinite(since)
        bad[1:] |= ~(np.diff(since) > 0)
    return np.asarray(bad)


@dataclass(frozen=True)
class OrderProblem:
    """row: the first whose time does not follow. text: the problem."""

    row: int
    text: str


def order_problem(time: Array) -> OrderProblem | None:
    """Problem of times (N,) [any unit] that do not increase; None where they do."""
    bad = np.flatnonzero(out_of_order(time))
    if not len(bad):
        return None
    row = int(bad[0])
    here, before = (f"{float(t):.15g}" for t in (time[row], time[max(row - 1, 0)]))
    text = f"time {here} does not follow {before}" if row else f"time {here}"
    known = time[np.isfinite(time)]
    steps = np.diff(np.unique(known))
    coarse = float(steps.min()) if len(steps) else 0.0
    if len(known) > 2 and np.all(np.diff(known) >= 0) and (coarse >= 1 or (not coarse and known[0] > _EPOCH)):
        lost = "several rows have the same time: its digits were lost when it was written (rounded)"
        return OrderProblem(row, f"{text}: {lost}; write seconds since the first row, or with all digits")
    return OrderProblem(row, f"{text}; expected increasing times")


def commands_of_rows(time: Array, joints: tuple[str, ...], goals: Array, enabled: NDArray[np.bool_] | None = None,
                     initial: Array | None = None, speeds: Array | None = None) -> Commands:
    """Rows of goals (N, n) [rad] at times (N,) [s] as commands, zero at the first row, only where something changes.

    enabled (N, n): torque, on if left out. speeds (N, n) [rad/s]: moving speeds; left out, or 0: at once. A blank goal repeats
    the last one, or before the first is `initial` (n,) [rad], neutral where that is unknown."""
    enabled = np.ones(goals.shape, dtype=bool) if enabled is None else enabled
    at = np.where(np.isfinite(goals), np.arange(len(goals))[:, None], -1)
    at = np.maximum.accumulate(at, axis=0)
    first = np.zeros(len(joints)) if initial is None else np.nan_to_num(initial)
    held = np.where(at >= 0, np.take_along_axis(goals, np.maximum(at, 0), axis=0), first)
    speeds = np.zeros(goals.shape) if speeds is None else speeds
    state = np.concatenate([held, enabled, speeds], axis=1)
    change = np.concatenate([[True], np.any(state[1:] != state[:-1], axis=1)])
    rows = np.flatnonzero(change)
    return Commands(times=time[rows] - time[0], joints=joints, goals=held[rows], speeds=speeds[rows],
                    enabled=enabled[rows], end=float(time[-1] - time[0]), poses=np.full(len(rows), -1), begun=True)
