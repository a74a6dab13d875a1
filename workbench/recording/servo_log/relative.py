"""Detects goals that are steps, from row to row or from the joint's position, instead of angles: relative actions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.recording.servo_log.following import JointLog, fit_following
from workbench.recording.servo_log.response import fit_response, shapes
from workbench.types import Array


@dataclass(frozen=True)
class RelativeChecks:
    """spans: rows over which a joint's travel is compared with the sum of its goals, and from its position with the goal (which
    then explains `from_place` of its variance). later: rows by which it may come later. explained: share of the travel's variance
    that the goals explain. tolerance: of the ratio of the two around 1, for steps from row to row; from the joint's position, a
    servo makes `least` to `largest` of it. absolute: share of the position's variance that the goals explain as angles, above
    which they are angles, if the joint does not move `beyond` times as far; of a swing, its own slope explains as much a quarter
    of a period later. smaller: the goals' range is at most so much of the position's, unless they are 0 in more than the share
    `rests` of the rows. fewest: least number of rows. added: share of the position's variance that summed goals explain for a
    servo that follows late and smoothed. moved, rounding: a position moves by more from row to row [deg], and a set point that
    stands by less [deg]; still: share of the moving rows in which it stands."""

    spans: tuple[int, ...] = (1, 2, 3, 5, 8, 12, 20)
    later: int = 6
    explained: float = 0.85
    tolerance: float = 0.4
    from_place: float = 0.7
    least: float = 0.25
    largest: float = 4.0
    absolute: float = 0.6
    beyond: float = 2.0
    smaller: float = 0.6
    fewest: int = 30
    added: float = 0.9
    rests: float = 0.8
    moved: float = 0.05
    rounding: float = 0.002
    still: float = 0.7


RELATIVE = RelativeChecks()
_FROM_PLACE = ("looks like the way from the position to the goal: relative actions; add each row's position to get angles before "
               "use")


def relative_goals(log: JointLog, c: RelativeChecks = RELATIVE) -> str | None:
    """A line if goals are steps instead of angles; None if they are angles, or if that cannot be decided."""
    goal, position = log.goal, log.position
    if len(goal) < c.fewest + max(c.spans) + c.later or np.ptp(goal) == 0 or np.ptp(position) == 0:
        return None
    if _makes_set_points(goal, position, c):
        return _FROM_PLACE
    impulses = np.mean(goal == 0) > c.rests  # steps of set points, as large as the motion itself
    if not impulses and np.ptp(goal) > c.smaller * np.ptp(position):
        return None
    fit = fit_following(log.time, goal, position)
    if fit.explained > c.absolute and fit.gain < c.beyond:
        return None
    added = fit_response(shapes(log.time, np.cumsum(goal)), position)
    steps = added.explained > c.added and abs(added.gain - 1) < c.tolerance and \
        np.mean((position - added.predicted) ** 2) < (1 - c.added) * np.var(position)
    if steps or _best(goal, position, c, summed=True):
        return ("looks like the change of the position from row to row: relative actions (deltas); add them up to angles before "
                "use")
    if _best(goal, position, c, summed=False):
        return _FROM_PLACE
    return None


def _makes_set_points(goal: Array, position: Array, c: RelativeChecks) -> bool:
    """Whether goals added to positions are constant, to within the rounding of both, in rows in which the position moves: then
    the goals are distances to set points that step."""
    for later in (0, 1):
        places = position[:len(position) - later]
        moved = np.flatnonzero(np.abs(np.diff(places)) > np.deg2rad(c.moved))
        points = goal[later:] + places
        still = np.abs(np.diff(points))[moved] < np.deg2rad(c.rounding)
        if len(moved) >= c.fewest and np.mean(still) > c.still and np.ptp(points) > np.deg2rad(c.moved):
            return True
    return False


def _best(goal: Array, position: Array, c: RelativeChecks, summed: bool) -> bool:
    total = np.concatenate([[0.0], np.cumsum(goal)])
    for span in c.spans:
        for later in range(c.later + 1):
            n = len(goal) - span - later
            way = position[later + span:later + span + n] - position[later:later + n]
            asked = total[span:span + n] - total[:n] if summed else goal[:n]
            if np.ptp(way) == 0 or np.ptp(asked) == 0:
                continue
            r = float(np.corrcoef(way, asked)[0, 1])
            slope = r * float(np.std(way) / np.std(asked))
            right = (r * r > c.explained and abs(slope - 1) < c.tolerance) if summed else \
                (r * r > c.from_place and c.least < slope < c.largest)
            if r > 0 and right:
                return True
    return False
