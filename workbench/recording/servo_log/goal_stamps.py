"""Goals that a log stamps with the time of its next row, though they were sent between two rows, at a regular period."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workbench.recording.recording import Recording
from workbench.types import Array

STAMPS = "goals sent within [s]"
"""Key of a recording's metadata: the length of the interval in which each goal was sent, once its stamp is corrected."""


@dataclass(frozen=True)
class StampChecks:
    """changes: of the goals, at least. rows: between two of them, at least. uneven: how far the mean period may be from a whole
    number of rows before the period counts as one that the rows do not hold [rows]. even: largest departure of the rows from
    their mean period [share of it]. tries: periods tried."""

    changes: int = 8
    rows: float = 3.0
    uneven: float = 0.02
    even: float = 0.2
    tries: int = 401


CHECKS = StampChecks()


@dataclass(frozen=True)
class Sent:
    """When the goals of a log were sent. first: the first, and period: between two, both in rows. poses: (K,) which of the
    periods each change of a goal belongs to. within: the interval that the stamps leave for the first [rows]."""

    first: float
    period: float
    poses: Array
    within: float


def sent_goals(rows: Array, c: StampChecks = CHECKS) -> Sent | None:
    """The regular period of goals that first appear in rows (K,); None where it is a whole number of rows, or no period
    explains them."""
    if len(rows) < c.changes:
        return None
    apart = np.diff(rows)
    usual = float(np.median(apart))
    if usual < c.rows:
        return None
    index = np.concatenate([[0.0], np.cumsum(np.round(apart / usual))])
    if np.any(np.diff(index) < 1):
        return None
    middle, _ = np.polyfit(index, rows, 1)
    if abs(middle - round(middle)) < c.uneven or abs(middle / usual - 1) > c.even:
        return None
    periods = middle + np.linspace(-1.5, 1.5, c.tries) / index[-1]
    left = rows[None, :] - periods[:, None] * index[None, :]
    earliest, latest = left.max(axis=1) - 1, left.min(axis=1)  # sent after the previous row, at the latest in its own
    best = int(np.argmax(latest - earliest))
    if latest[best] <= earliest[best]:
        return None
    return Sent(float(latest[best] + earliest[best]) / 2, float(periods[best]), index, float(latest[best] - earliest[best]))


def with_sent_times(r: Recording, c: StampChecks = CHECKS) -> Recording:
    """The recording with the commands at the times at which they were sent, where their rows show a regular period; a note
    reports the correction, and the metadata (`STAMPS`) holds the remaining uncertainty."""
    commands = r.commands
    if commands is None or r.sensing != "encoders" or "first command" in r.metadata or len(commands.times) < c.changes:
        return r
    row = float(np.median(np.diff(r.time)))
    if np.ptp(np.diff(r.time)) > 0.5 * row:
        return r
    changed = np.concatenate([[False], np.abs(np.diff(commands.goals, axis=0)).max(axis=1) > 0])
    only_goals = np.all(commands.enabled == commands.enabled[0])
    rows = np.searchsorted(r.time - r.time[0], commands.times[changed] - 0.25 * row).astype(float)
    sent = sent_goals(rows, c) if only_goals else None
    if sent is None or changed.sum() < len(commands.times) - 1:
        return r
    times = commands.times.copy()
    times[changed] = np.maximum((sent.first + sent.period * sent.poses) * row, 1e-6)
    late = 1e3 * float(np.mean(commands.times[changed] - times[changed]))
    within = sent.within * row
    note = (f"goals change every {1e3 * sent.period * row:.2f} ms, which is no whole number of rows ({1e3 * row:.4g} ms): they "
            f"were stamped with the next row, {late:.1f} ms late on average; set to the times at which they were sent (known to "
            f"{1e3 * within:.1f} ms)")
    return replace(r, commands=replace(commands, times=times), notes=(*r.notes, note),
                   metadata={**r.metadata, STAMPS: repr(within)})
