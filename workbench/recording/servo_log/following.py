"""How a joint follows its goals: with a lag, a gain and a constant offset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.recording.recording import Recording
from workbench.types import Array


@dataclass(frozen=True)
class FollowChecks:
    """longest: largest lag tried [s]. most: number of lags, evenly spaced. fewest: least number of usable rows. goes: goals and
    joints that move less are not used [deg]."""

    longest: float = 0.4
    most: int = 25
    fewest: int = 30
    goes: float = 4.0


FOLLOW = FollowChecks()


@dataclass(frozen=True)
class Followed:
    """position(t) = gain * goal(t - lag) + offset. lag [s], offset [rad]. explained: share of the position's variance that this
    explains, at most 1; 0 where the goal does not predict the position, or where its gain is negative."""

    lag: float
    gain: float
    offset: float
    explained: float

    def predicted(self, time: Array, goal: Array) -> Array:
        """Position (N,) [rad] at the log's times (N,) [s] from its goals (N,) [rad]."""
        return self.gain * np.interp(time - self.lag, time, goal) + self.offset


@dataclass(frozen=True)
class JointLog:
    """Rows in which a joint has both goal and position and its torque is on. rows: (K,) of the recording. time [s], goal and
    position [rad], all (K,)."""

    name: str
    rows: NDArray[np.int_]
    time: Array
    goal: Array
    position: Array


def joint_logs(r: Recording, c: FollowChecks = FOLLOW) -> dict[str, JointLog]:
    """The usable joints of a log, by name; a blank goal repeats the last one."""
    out = {}
    for joint in r.joints:
        goal, position = r.channels.get(f"goal.{joint}"), r.channels.get(f"position.{joint}")
        if goal is None or position is None or not np.isfinite(goal).any():
            continue
        goal = _fill_gaps(goal)
        on = np.isfinite(goal) & np.isfinite(position) & (r.channels.get(f"enabled.{joint}", np.ones(len(goal))) != 0)
        rows = np.flatnonzero(on)
        if len(rows) >= c.fewest:
            out[joint] = JointLog(joint, rows, r.time[rows], goal[rows], position[rows])
    return out


def fit_following(time: Array, goal: Array, position: Array, c: FollowChecks = FOLLOW) -> Followed:
    """The lag, gain and offset with which positions (N,) [rad] follow goals (N,) [rad] at times (N,) [s] best."""
    nothing = Followed(0.0, 0.0, float(position.mean()) if len(position) else 0.0, 0.0)
    if len(time) < 3 or np.ptp(goal) == 0 or np.ptp(position) == 0:
        return nothing
    longest = min(c.longest, 0.25 * float(time[-1] - time[0]))
    lags = np.linspace(0.0, longest, c.most)
    asked = np.interp(time[None, :] - lags[:, None], time, goal)
    inside = time - time[0] >= longest
    if inside.sum() < 3:
        return nothing
    a = asked[:, inside] - asked[:, inside].mean(axis=1, keepdims=True)
    b = position[inside] - position[inside].mean()
    size, total = (a * a).sum(axis=1), float(b @ b)
    if total == 0 or not size.any():
        return nothing
    along = a @ b
    gain = along / np.where(size > 0, size, np.inf)
    explained = np.where(along > 0, along * gain / total, 0.0)
    best = int(np.argmax(explained))
    offset = float(position[inside].mean() - gain[best] * asked[best, inside].mean())
    return Followed(float(lags[best]), float(gain[best]), offset, float(explained[best]))


def _fill_gaps(goal: Array) -> Array:
    """Goals (N,) with blanks filled by the last one before, or after."""
    at = np.maximum.accumulate(np.where(np.isfinite(goal), np.arange(len(goal)), -1))
    first = int(np.flatnonzero(np.isfinite(goal))[0])
    return np.asarray(goal[np.where(at >= 0, at, first)])
