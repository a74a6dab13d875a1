"""Detects positions that cannot be a servo's response to its goals: another quantity, another take, or corrupted values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from workbench.recording.servo_log.following import JointLog, fit_following
from workbench.recording.servo_log.response import fit_response, shapes
from workbench.recording.servo_log.state import count_of
from workbench.types import Array


@dataclass(frozen=True)
class UnlikeChecks:
    """goes: least motion of goal and position [deg]. follows: share of the position's variance below which its goals explain
    nothing (the least of 166 joints in 76 real logs is 0.55); none_follow: the same where it holds for all joints. instead: share
    that another quantity must explain. gain: a joint does not go farther than so many times the way of its goals. drift,
    straight: change of the distance between position and goals from the log's beginning to its end [deg], and the share of that
    distance's mean square that the change explains; stiff: only of a servo that goes more than this share of its goals' way, as
    a load moves others. noise, alternates: median second difference of the readings [deg], and the correlation of one with the
    next, which is -0.67 for white noise. coarse: step of the readings above which they were rounded [deg]. fewest: least number
    of rows."""

    goes: float = 5.0
    follows: float = 0.3
    none_follow: float = 0.65
    instead: float = 0.8
    gain: float = 1.3
    drift: float = 6.0
    straight: float = 0.7
    stiff: float = 0.7
    noise: float = 1.5
    alternates: float = -0.45
    coarse: float = 0.8
    fewest: int = 30


UNLIKE = UnlikeChecks()


def unlike(log: JointLog, c: UnlikeChecks = UNLIKE) -> Iterator[str]:
    """A line for each reason why a position cannot be a servo's response to its goals, without the channel's name."""
    asked, seen = np.rad2deg(np.ptp(log.goal)), np.rad2deg(np.ptp(log.position))
    if len(log.time) < c.fewest or min(asked, seen) < c.goes:
        return
    yield from _noise(log, c)
    shaped = shapes(log.time, log.goal)
    fit, late = fit_response(shaped, log.position), fit_following(log.time, log.goal, log.position)
    if late.explained < c.follows:
        yield f"does not follow goal.{log.name}: {_instead(log, c)}"
    elif fit.explained > c.instead and (gain := min(fit.gain, late.gain)) > c.gain:
        yield (f"goes {gain:.2f} times as far as goal.{log.name}, which no servo does: is one of them in another unit (per "
               "cent, counts), or is a gear between servo and joint?")
    elif fit.gain > c.stiff:
        yield from _drift(log, shaped, c)


def none_follows(logs: Mapping[str, JointLog], c: UnlikeChecks = UNLIKE) -> str | None:
    """A line for a log of two or more moving joints none of which follows its goals; None if one does."""
    moving = {j: log for j, log in logs.items() if np.rad2deg(min(np.ptp(log.goal), np.ptp(log.position))) >= c.goes}
    if len(moving) < 2 or any(fit_following(x.time, x.goal, x.position).explained >= c.none_follow for x in moving.values()):
        return None
    return (f"position.{', position.'.join(moving)}: no joint follows its goals: are positions and goals from two takes, from "
            "two clocks, or in another order of the joints?")


def _instead(log: JointLog, c: UnlikeChecks) -> str:
    """The likely cause of a position that does not follow its goals."""
    if fit_following(log.time, np.abs(log.goal), log.position).explained > c.instead:
        return "it looks like the goal's absolute value: was the sign lost?"
    rate = np.gradient(log.goal, log.time)
    if fit_response(shapes(log.time, rate), log.position).explained > c.instead:
        return "it looks like the goal's rate of change: a velocity or the control error (goal less position), not an angle?"
    return "is it the recording of another take or another joint, or has it another clock than the goals?"


def _drift(log: JointLog, shaped: Array, c: UnlikeChecks) -> Iterator[str]:
    rows = np.arange(0, len(log.time), max(1, len(log.time) // 400))
    since = (log.time[rows] - log.time[0]) / float(log.time[-1] - log.time[0])
    position = np.rad2deg(log.position[rows])
    still, moving = (np.inf, 0.0), (np.inf, 0.0)  # mean square [deg^2] and drift [deg] of the best fit without and with a drift
    for shape in shaped[:, rows]:
        for drifts in (False, True):
            gravity = (np.sin(shape), np.cos(shape))  # a weak servo sags by as much
            basis = np.column_stack([shape, np.ones(len(rows)), *gravity, *([since] if drifts else [])])
            found = np.linalg.lstsq(basis, position, rcond=None)[0]
            square = float(np.mean((position - basis @ found) ** 2))
            if drifts and square < moving[0]:
                moving = square, float(found[-1])
            elif not drifts and square < still[0]:
                still = square, 0.0
    if abs(moving[1]) > c.drift and moving[0] < (1 - c.straight) * still[0]:
        yield (f"drifts by {moving[1]:+.1f} deg against goal.{log.name} from the first row to the last: a horn or coupling that "
               "slips, or a sensor whose zero creeps (warm potentiometer, integrated gyro)?")


def _noise(log: JointLog, c: UnlikeChecks) -> Iterator[str]:
    bends = np.rad2deg(np.diff(log.position, 2))
    middle = float(np.median(np.abs(bends)))
    if middle > c.noise and np.corrcoef(bends[:-1], bends[1:])[0, 1] < c.alternates:
        noise = middle / (0.6745 * np.sqrt(6.0))
        yield (f"scatters by {noise:.2g} deg from row to row, more than a servo's sensor does: a worn potentiometer, a loose "
               "cable, or an estimate instead of the servo's reading?")


def find_rounding(position: Array, c: UnlikeChecks = UNLIKE) -> str | None:
    """A line if positions (N,) [rad] were rounded to more than a sensor's count; None if not."""
    count = _step(np.rad2deg(position[np.isfinite(position)]))
    if count <= c.coarse:
        return None
    return (f"changes in steps of {count:.3g} deg, coarser than a servo's sensor: was it rounded when written? Log it with two "
            "decimals")


def _step(values: Array) -> float:
    """The step [deg] of which values (N,) [deg] are multiples, or 0 where there is no such step or few values tell."""
    levels = np.unique(np.round(values, 4))
    if len(levels) < 5:
        return 0.0
    steps = np.diff(levels)
    if len(levels) < 20 and np.allclose(steps / steps.min(), np.round(steps / steps.min()), atol=0.01):
        return float(steps.min())
    count = count_of(levels)
    return float(count) if np.isfinite(count) else 0.0
