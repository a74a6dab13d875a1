"""Finds when a motion began in a servo log from the log's own goals, and detects goals that the servo itself ramps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.motion.commands import Commands
from workbench.recording.recording import Recording
from workbench.recording.servo_log.following import fit_following, joint_logs
from workbench.types import Array


@dataclass(frozen=True)
class StartChecks:
    """changes: of a log's goals that are tried as the motion's first. moves: a goal that changes less does not begin a motion
    [deg]. ramp: share of the time between goals by which all joints lag where servos ramp them. rows: least duration of a goal.
    follows: share of a position's variance that the lagging goals must explain. joints: least number of usable joints."""

    changes: int = 60
    moves: float = 0.2
    ramp: float = 0.35
    rows: int = 4
    follows: float = 0.8
    joints: int = 2


START = StartChecks()


def start_in_log(r: Recording, commands: Commands, c: StartChecks = START) -> float | None:
    """Time on the log's clock [s] of the first command of a motion, by the best fit to the log's own goals; None for a log
    without goals, or whose goals or motion never change, or that contains its start."""
    sent = r.commands
    if r.sensing != "encoders" or sent is None or "first command" in r.metadata:
        return None
    joints = [j for j in commands.joints if j in sent.joints]
    if not joints:
        return None
    logged = sent.goals[:, [sent.joints.index(j) for j in joints]]
    asked = commands.goals[:, [commands.joints.index(j) for j in joints]]
    least = np.deg2rad(c.moves)
    changes = np.flatnonzero(np.abs(np.diff(logged, axis=0)).max(axis=1, initial=0.0) > least) + 1
    from_neutral = np.abs(np.diff(np.vstack([logged[:1], asked]), axis=0)).max(axis=1) > least
    if not len(changes) or not from_neutral.any():
        return None
    first = float(commands.times[int(np.argmax(from_neutral))])
    starts = [s for s in sent.times[changes[:c.changes]] - first if s >= -1e-9]
    if not starts:
        return None
    misfit = [_misfit(sent.times, logged, commands.times + s, asked) for s in starts]
    return float(r.time[0] + max(starts[int(np.argmin(misfit))], 0.0))


def _misfit(times: Array, logged: Array, at: Array, asked: Array) -> float:
    """Mean square difference [rad^2] between logged goals (K, n) at times (K,) and requested goals (M, n) at times (M,) [s],
    evaluated at both sets of times; each goal is held until the next."""
    when = np.unique(np.concatenate([times, at])) + 1e-6
    a = logged[np.clip(np.searchsorted(times, when, side="right") - 1, 0, len(times) - 1)]
    b = asked[np.clip(np.searchsorted(at, when, side="right") - 1, 0, len(at) - 1)]
    before = when < at[0]
    b[before] = logged[0]
    weights = np.diff(np.append(when, when[-1]))
    return float(np.average(((a - b) ** 2).mean(axis=1), weights=weights if weights.sum() > 0 else None))


def ramp_problems(r: Recording, c: StartChecks = START) -> Iterator[str]:
    """A line if all joints lag by a good part of the time between goals: the servos ramp their goals, and the log does not say
    how fast."""
    if any(name.startswith("speed.") for name in r.channels):
        return
    row = float(np.median(np.diff(r.time)))
    shares, lags, dwells = [], [], []
    for log in joint_logs(r).values():
        changed = np.flatnonzero(np.abs(np.diff(log.goal)) > np.deg2rad(c.moves))
        if len(changed) < 4:
            continue
        dwell = float(np.median(np.diff(log.time[changed])))
        fit = fit_following(log.time, log.goal, log.position)
        if dwell < c.rows * row or fit.explained < c.follows:
            return
        shares.append(fit.lag / dwell)
        lags.append(fit.lag)
        dwells.append(dwell)
    if len(shares) < c.joints or min(shares) < c.ramp:
        return
    yield (f"all {len(lags)} joints that move lag by {1e3 * min(lags):.0f} to {1e3 * max(lags):.0f} ms, a good part of the "
           f"{1e3 * float(np.median(dwells)):.0f} ms between goals: does the servo ramp its goal (a move time or moving "
           f"speed)? Then "
           "add columns speed.J [deg/s], the way over the move time, or give the session's motion:")
