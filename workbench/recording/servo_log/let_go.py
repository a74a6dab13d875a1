"""From when on a joint no longer depends on its goals: its servo let go, or its sensor stood still."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.recording.servo_log.following import FOLLOW, Followed, JointLog, followed
from workbench.types import Array


@dataclass(frozen=True)
class LetGoChecks:
    """before: share of the position's variance that the goals give until then, with a gain of at least `firm`; they must have
    gone back by `back` of their range, as a way to a stop shows no gain. stands: the joint then moves by so much of what its
    goals ask, at most, for so long at least [s] as `lasts` says, in which the goals go on by `goes` [deg] and by `share` of what
    they went before. leaves: RMS by which the joint is then off its way, in those before. settles: after it let go [s].
    tries: how many times are tried. most: rows that are looked at, evenly chosen."""

    before: float = 0.9
    firm: float = 0.5
    back: float = 0.3
    stands: float = 0.2
    lasts: float = 0.8
    goes: float = 5.0
    share: float = 0.5
    leaves: float = 4.0
    settles: float = 0.4
    tries: int = 24
    most: int = 800


LET_GO = LetGoChecks()


def lets_go(log: JointLog, c: LetGoChecks = LET_GO) -> int | None:
    """Row of the log (of its K) from which on the position does not depend on the goals; None where it does to the end."""
    each = max(1, len(log.rows) // c.most)
    time, goal, position = log.time[::each], log.goal[::each], log.position[::each]
    last = time[-1] - c.lasts - c.settles
    first = time[0] + max(0.1 * (time[-1] - time[0]), 1.0)
    if last <= first:
        return None
    for start in np.linspace(first, last, c.tries):
        until = time < start
        if until.sum() < FOLLOW.fewest:
            continue
        fit = followed(time[until], goal[until], position[until])
        follows = fit.explained >= c.before and fit.gain >= c.firm and _goes_back(goal[until], c)
        if follows and _free(time, goal, position, start, fit, c):
            left = np.abs(position - fit.predicted(time, goal))
            usual = float(np.sqrt(np.mean(left[until] ** 2)))
            gone = np.flatnonzero((left > c.leaves * usual) & (time >= start - 2 * (last - first) / c.tries))
            return int(min(gone[0] if len(gone) else np.argmax(~until), len(time) - 1)) * each
    return None


def _free(time: Array, goal: Array, position: Array, start: float, fit: Followed, c: LetGoChecks) -> bool:
    """Whether from `start` on to the end the joint goes its own way, while it is asked to move, and no stop holds it."""
    until, then = time < start, time >= start + c.settles
    asked = goal[then]
    if np.rad2deg(np.ptp(asked)) < c.goes or np.ptp(asked) < c.share * np.ptp(goal[until]):
        return False
    predicted = fit.predicted(time, goal)
    away = np.sqrt(np.mean((position - predicted)[then] ** 2))
    usual = np.sqrt(np.mean((position - predicted)[until] ** 2))
    if away < max(c.leaves * usual, np.deg2rad(c.goes) / 4):
        return False
    if np.std(position[then]) > c.stands * fit.gain * np.std(asked):
        return False
    stands, slack = float(np.median(position[then])), 2 * usual
    at_upper = stands >= np.max(position[until]) - slack and np.mean(predicted[then] > stands - slack) > 0.9
    at_lower = stands <= np.min(position[until]) + slack and np.mean(predicted[then] < stands + slack) > 0.9
    return not (at_upper or at_lower)


def _goes_back(goal: Array, c: LetGoChecks) -> bool:
    """Whether goals (N,) went and came back."""
    least = c.back * np.ptp(goal)
    up = np.max(goal - np.minimum.accumulate(goal))
    down = np.max(np.maximum.accumulate(goal) - goal)
    return bool(min(up, down) > least)
