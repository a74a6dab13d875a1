"""Finds joints that do not obey their goals: that never follow, that stop at one value, or that differ by a constant."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.recording.runs import runs_of_true
from workbench.recording.servo_log.following import JointLog
from workbench.recording.servo_log.response import Response, fit_response, shapes


@dataclass(frozen=True)
class HeldBackChecks:
    """goes: least motion of a goal [deg]. follows: a joint whose goals explain less of its variance, or that moves over less than
    `moves` of their range, does not follow them. piles: share of the rows at which a joint rests at its extreme reading, to the
    last digit, while its goals are `beyond` further [deg]; `visits`: least number of such rests, each of at least `rows` rows.
    off: a constant distance from the goals [deg], of a joint that follows them with a gain of 1 +- `tolerance`, to `explained` of
    its variance, and with a residual of at most `share` of that distance."""

    goes: float = 5.0
    follows: float = 0.3
    moves: float = 0.15
    piles: float = 0.04
    beyond: float = 6.0
    visits: int = 3
    rows: int = 3
    off: float = 12.0
    tolerance: float = 0.15
    explained: float = 0.95
    share: float = 0.25


HELD_BACK = HeldBackChecks()


def held_back(log: JointLog, c: HeldBackChecks = HELD_BACK) -> Iterator[str]:
    """A line for what keeps a joint from its goals throughout the log, without the channel's name."""
    if np.rad2deg(np.ptp(log.goal)) < c.goes:
        return
    shaped = shapes(log.time, log.goal)
    fit = fit_response(shaped, log.position)
    asked, seen = np.rad2deg(np.ptp(log.goal)), np.rad2deg(np.ptp(log.position))
    if seen < c.moves * asked and fit.explained < c.follows:
        yield (f"does not follow goal.{log.name}: it moves over {seen:.3g} deg where the goal moves over {asked:.3g} deg: torque "
               "off, a gain of 0, a servo or horn that came loose, or another joint's column?")
        return
    yield from _ends(log, c)
    if fit.explained < c.explained or abs(fit.gain - 1) > c.tolerance:
        return
    yield from _stands_off(log, fit, c)


def _ends(log: JointLog, c: HeldBackChecks) -> Iterator[str]:
    for sign, which in ((1, "above"), (-1, "below")):
        value = float(np.max(sign * log.position)) * sign
        there = log.position == value
        visits = [(a, b) for a, b in runs_of_true(there) if b - a >= c.rows
                  and np.rad2deg(np.max(sign * (log.goal[a:b] - value))) > c.beyond]
        rows = sum(b - a for a, b in visits)
        if len(visits) >= c.visits and rows > c.piles * len(there):
            most = np.rad2deg(max(float(np.max(sign * log.goal[a:b])) for a, b in visits)) * sign
            yield (f"is never {which} {np.rad2deg(value):.4g} deg, where it rests to the last digit {len(visits)} times while "
                   f"the goal continues to {most:.4g} deg: a stop, or a sensor or register that is cut off there?")


def _stands_off(log: JointLog, fit: Response, c: HeldBackChecks) -> Iterator[str]:
    away = np.rad2deg(log.position - (fit.predicted - fit.offset) / fit.gain)
    middle = float(np.median(away))
    if abs(middle) > c.off and np.rad2deg(fit.spread) < c.share * abs(middle):
        yield (f"is {middle:+.1f} deg from goal.{log.name} throughout, although it follows it: are their zeros the same (a "
               "homing offset, a horn turned by a tooth)?")
