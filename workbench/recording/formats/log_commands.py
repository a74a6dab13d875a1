"""Commands contained in a servo log: a goal in each row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.motion.commands import Commands
from workbench.types import Array, Mask


def out_of_order(time: Array) -> Mask:
    """Which of times (N,) [any unit] are not finite, or not later than the one before. Times are compared after the first is
    subtracted, as readers do that: a first time of -1e308 makes all the others equal."""
    with np.errstate(over="ignore", invalid="ignore"):
        since = time - time[:1]
        bad = ~np.isfinite(since)
        bad[1:] |= ~(np.diff(since) > 0)
    return np.asarray(bad)


_LOST = "several rows have the same time: its digits were lost when it was written"
_ALL_DIGITS = "write seconds since the first row, or with all digits"


@dataclass(frozen=True)
class OrderProblem:
    """row: the first whose time does not follow. text: the problem."""

    row: int
    text: str


def order_problem(time: Array) -> OrderProblem | None:
    """The problem of times (N,) [any unit] that do not increase; None if they do."""
    bad = np.flatnonzero(out_of_order(time))
    if not len(bad):
        return None
    row = int(bad[0])
    here, before = (f"{float(t):.15g}" for t in (time[row], time[max(row - 1, 0)]))
    text = f"time {here} does not follow {before}" if row else f"time {here}"
    return OrderProblem(row, f"{text}: {_why_out_of_order(time)}")


def _why_out_of_order(time: Array) -> str:
    """The likely cause, and its remedy, of times (N,) [any unit] that do not increase."""
    known = time[np.isfinite(time)]
    if len(known) < len(time) or len(known) < 3:
        return "expected increasing times"
    steps = np.diff(known)
    if not steps.any():
        return f"{_LOST} (rounded); {_ALL_DIGITS}"
    if np.all(steps < 0):
        return "all rows are in reverse order: sort them by time"
    back = np.flatnonzero(steps < 0)
    if not len(back):
        repeated = np.flatnonzero(steps == 0)
        if not len(repeated):
            return "expected increasing times"
        lost = len(repeated) > 0.2 * len(steps) or float(steps[steps > 0].min()) >= 1
        return f"{_LOST} (rounded); {_ALL_DIGITS}" if lost else \
            f"{len(repeated)} row(s) occur twice: delete the second of each"
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    falls = known[back] - known[back + 1] + usual
    for bits in (16, 32):
        for unit in (1.0, 1e-3, 1e-6):
            if np.all(np.abs(falls - 2.0**bits * unit) < 3 * usual):
                return f"a counter of {bits} bits that starts again: add {2.0**bits * unit:.10g} to the times from there on"
    for wraps, clock in ((86400.0, "a day, at midnight"), (43200.0, "half a day"), (3600.0, "an hour")):
        for unit, name in ((1.0, "s"), (1e3, "ms"), (1e6, "us")):
            if usual < 0.01 * wraps * unit and np.all(np.abs(falls - wraps * unit) < 3 * usual):
                return f"a clock that starts again after {clock}: add {wraps * unit:.10g} {name} to the times from there on"
    if len(back) == 1 and known[back[0] + 1] <= known[0] + usual:
        return "the times start again: two logs in one file? Split it there"
    if len(back) <= 0.05 * len(steps):
        return f"{len(back)} time(s) go back: sort the rows by time, or use a clock that is not set while logging (monotonic)"
    return "expected increasing times"


def commands_of_rows(time: Array, joints: tuple[str, ...], goals: Array, enabled: Mask | None = None,
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
