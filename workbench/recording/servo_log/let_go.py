"""Finds stretches in which a joint does not depend on its goals, because its servo released or its sensor froze, for a time or to
the end."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.recording.runs import runs_of_true
from workbench.recording.servo_log.following import JointLog
from workbench.recording.servo_log.response import Response, fit_response, shapes
from workbench.types import Array, Mask


@dataclass(frozen=True)
class LetGoChecks:
    """before: share of the position's variance that the goals explain elsewhere, with a gain of at least `firm`; the goals must
    move back and forth there by `back` of their range, as an approach to a stop shows no gain. leaves: the joint then deviates by
    more than so many robust standard deviations, and by `least` [deg]. bridges: shorter deviations, or returns, do not count [s].
    stands: the joint then moves by at most this share of its goals' motion. lasts: for so long at least [s]. goes: meanwhile the
    goals move by so much [deg], and by `share` of their range in the whole log. settles: after release, and after it holds
    again, time within which its movement does not count [s]. prefixes: shares of the log on which the response is fitted, besides
    the whole. tight: a stretch begins and ends where the joint deviates by so many standard deviations."""

    before: float = 0.85
    firm: float = 0.5
    back: float = 0.3
    leaves: float = 4.0
    least: float = 3.0
    bridges: float = 0.25
    stands: float = 0.25
    lasts: float = 0.6
    goes: float = 5.0
    share: float = 0.4
    settles: float = 0.35
    prefixes: tuple[float, ...] = (0.12, 0.2, 0.35, 0.55, 1.0)
    tight: float = 3.0


LET_GO = LetGoChecks()


def lets_go(log: JointLog, c: LetGoChecks = LET_GO) -> list[tuple[int, int]]:
    """Stretches of the log (first row, row after the last, of its K) in which the position does not depend on the goals."""
    if np.rad2deg(np.ptp(log.goal)) < c.goes or len(log.time) < 3:
        return []
    shaped = shapes(log.time, log.goal)
    span = float(log.time[-1] - log.time[0])
    best: list[tuple[int, int]] = []
    for share in c.prefixes:
        early = log.time - log.time[0] <= share * span
        fit = fit_response(shaped, log.position, early)
        if fit.explained < c.before or fit.gain < c.firm or not _goes_back(log.goal[early], c):
            continue
        found = [s for s in _join(log, _stretches(log.time, log.position, fit, c), fit, c)
                 if log.time[s[1] - 1] - log.time[s[0]] >= c.lasts and _free(log, s, fit, c)]
        rest = np.ones(len(log.time), dtype=bool)
        for first, end in found:
            rest[first:end] = False
        if found and _follows(shaped, log, rest, c):
            best = max(best, found, key=lambda of: sum(b - a for a, b in of))
    return best


def _stretches(time: Array, position: Array, fit: Response, c: LetGoChecks) -> list[tuple[int, int]]:
    """Stretches in which the joint deviates from its expected path; each begins and ends on that path."""
    away = np.abs(position - fit.predicted)
    near = np.flatnonzero(away < c.tight * fit.spread)
    out: list[tuple[int, int]] = []
    for first, end in runs_of_true(away > max(c.leaves * fit.spread, np.deg2rad(c.least))):
        before, after = np.searchsorted(near, (first, end))
        begin, stop = int(near[before - 1]) + 1 if before else 0, int(near[after]) if after < len(near) else len(time)
        if out and begin < out[-1][1]:
            continue
        out.append((begin, stop))
    return out


def _join(log: JointLog, stretches: list[tuple[int, int]], fit: Response, c: LetGoChecks) -> list[tuple[int, int]]:
    """Joins stretches that are separated only by a crossing of the expected path: between them, too, the joint rests although it
    is commanded to move."""
    out: list[tuple[int, int]] = []
    for first, end in stretches:
        if log.time[end - 1] - log.time[first] < c.bridges:
            continue
        if out and (log.time[first] - log.time[out[-1][1] - 1] < c.bridges or _is_at_rest(log, (out[-1][1], first), fit, c)):
            out[-1] = (out[-1][0], end)
        else:
            out.append((first, end))
    return out


def _is_at_rest(log: JointLog, between: tuple[int, int], fit: Response, c: LetGoChecks) -> bool:
    rows = slice(*between)
    asked = float(np.ptp(fit.predicted[rows]))
    return bool(np.rad2deg(asked) > 2 * c.least and np.ptp(log.position[rows]) < c.stands * asked)


def _free(log: JointLog, stretch: tuple[int, int], fit: Response, c: LetGoChecks) -> bool:
    """Whether in a stretch the joint ignores commanded motion without being held by a stop."""
    first, end = stretch
    lasts_to = log.time[end - 1] - (c.settles if end < len(log.time) else 0.0)
    settles = min(c.settles, 0.3 * float(log.time[end - 1] - log.time[first]))
    inside = (np.arange(len(log.time)) >= first) & (np.arange(len(log.time)) < end)
    then = inside & (log.time >= log.time[first] + settles) & (log.time <= max(lasts_to, log.time[first] + 2 * settles))
    if then.sum() < 5:
        return False
    asked, seen = fit.predicted[then], log.position[then]
    if np.rad2deg(np.ptp(asked)) < c.goes or np.ptp(asked) < c.share * np.ptp(fit.predicted):
        return False
    if np.std(seen) > c.stands * np.std(asked):
        return False
    stands, slack = float(np.median(seen)), 2 * fit.spread + np.deg2rad(0.5)
    others = log.position[~inside]
    at_upper = stands >= np.quantile(others, 0.99) - slack and np.mean(asked > stands - slack) > 0.9
    at_lower = stands <= np.quantile(others, 0.01) + slack and np.mean(asked < stands + slack) > 0.9
    return not (at_upper or at_lower)


def _follows(shaped: Array, log: JointLog, rest: Mask, c: LetGoChecks) -> bool:
    """Whether the joint follows its goals outside the stretches."""
    fit = fit_response(shaped, log.position, rest)
    return fit.explained >= c.before and fit.gain >= c.firm


def _goes_back(goal: Array, c: LetGoChecks) -> bool:
    """Whether goals (N,) moved away and back."""
    least = c.back * np.ptp(goal)
    up = np.max(goal - np.minimum.accumulate(goal))
    down = np.max(np.maximum.accumulate(goal) - goal)
    return bool(len(goal) and min(up, down) > least)
