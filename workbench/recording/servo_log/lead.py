"""Detects joints that precede their goals: a servo follows, so such goals were logged late, or derived from the motion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.recording.recording import Recording
from workbench.types import Array


@dataclass(frozen=True)
class LeadChecks:
    """When a joint is taken to precede its goal.

    longest: largest lead or lag tried [s]; share: of the log, at most, whose ends are then not used. rows: least lead, as a row's
    goal may be sent after its position was read. step: fineness of leads, in rows. better: residual RMS with the lead, relative
    to that with the best lag; near 1 for noise, and for a periodic motion, whose leads are also lags (of 44 logs, 0.6 flags none,
    0.75 one). likeness: share of the position's variance that the lead explains. goes: least motion of a joint [deg]. fewest:
    least number of rows.
    """

    longest: float = 0.4
    share: float = 0.2
    rows: float = 1.5
    step: float = 0.5
    better: float = 0.6
    likeness: float = 0.9
    goes: float = 5.0
    fewest: int = 30


LEADS = LeadChecks()


def lead_problems(r: Recording, c: LeadChecks = LEADS) -> Iterator[str]:
    """A line for each joint whose positions precede its goals."""
    for joint in r.joints:
        goal, position = r.channels.get(f"goal.{joint}"), r.channels.get(f"position.{joint}")
        if goal is None or position is None:
            continue
        on = np.isfinite(goal) & np.isfinite(position) & (r.channels.get(f"enabled.{joint}", np.ones(len(goal))) != 0)
        if on.sum() < c.fewest or min(np.rad2deg(np.ptp(goal[on])), np.rad2deg(np.ptp(position[on]))) < c.goes:
            continue
        lead = _lead(r.time[on], goal[on], position[on], c)
        if lead is not None:
            yield (f"position.{joint}: precedes goal.{joint} by {1e3 * lead:.0f} ms, which no servo does: were the goals logged "
                   "late, or derived from the motion, or are the two columns exchanged?")


def _lead(time: Array, goal: Array, position: Array, c: LeadChecks) -> float | None:
    """The time [s] by which positions (N,) [rad] precede goals (N,) [rad] at times (N,) [s]; None if they do not."""
    row = float(np.median(np.diff(time)))
    most = min(c.longest, c.share * float(time[-1] - time[0]))
    steps = round(most / (row * c.step))
    lags = np.arange(-steps, steps + 1) * row * c.step
    inside = (time >= time[0] + most) & (time <= time[-1] - most)
    if inside.sum() < c.fewest:
        return None
    seen = position[inside] - position[inside].mean()
    left = np.array([_unexplained_share(np.interp(time[inside] - lag, time, goal), seen) for lag in lags])
    best = int(np.argmin(left))
    ahead = lags <= -c.rows * row
    if not ahead[best] or left[best] > 1 - c.likeness or best == 0:
        return None
    return float(-lags[best]) if np.sqrt(left[best]) < c.better * np.sqrt(left[lags >= 0].min()) else None


def _unexplained_share(goal: Array, position: Array) -> float:
    """Share of a position's variance that a goal, scaled by a positive number and moved, does not explain. position: less its
    mean."""
    a, b = goal - goal.mean(), position
    total, along = _product(b, b), _product(a, b)
    if total == 0 or along <= 0:
        return 1.0
    return 1 - along**2 / (total * _product(a, a))


def _product(a: Array, b: Array) -> float:
    """a @ b on one core: BLAS would wake all of them for each of hundreds of short products."""
    return float(np.einsum("i,i->", a, b))
