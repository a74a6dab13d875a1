"""The closed loop: a robot that is not the model, cameras with noise and lost frames, one decision a cycle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import Context

from workbench.compare.metrics import heading
from workbench.gait.drive.controller import CycleController
from workbench.gait.drive.family import STRAIGHT, Steer
from workbench.gait.drive.path import WayPath
from workbench.gait.drive.walk import Seen, StoppedError, Walk
from workbench.recording.take import Take
from workbench.types import Array, Mask, Progress

Watch = Callable[[Seen, Array], None]
"""Called at the end of each cycle with the robot's pose and the planned positions (N, 2) [m]."""
FELL, END = "fell", "end of the path"
"""Reasons for which a walk ends."""
SETTLED = 0.8
"""Distance along the path [m] from which errors are judged: with two cycles of delay and an unknown bias the first part is open
loop."""


@dataclass(frozen=True, eq=False)
class Driven:
    """What came of it. poses (K, 3): x, y [m], heading [rad] at the end of each cycle, true; seen (K, 3): as captured; turns (K,)
    [rad per stance] and sides (K,) [m per stance] of the cycle that ends there; left (K,) [m], off (K,) [rad], along (K,) [m]:
    true errors from the path; bias (K,): estimated [rad per cycle], NaN if not steered. reason: why it stopped. take: the whole
    run."""

    path: WayPath
    poses: Array
    seen: Array
    turns: Array
    sides: Array
    left: Array
    off: Array
    along: Array
    bias: Array
    reason: str
    take: Take

    @property
    def settled(self) -> Mask:
        """Cycles whose errors are judged."""
        return np.asarray(self.along >= min(SETTLED, self.path.length / 2))

    def missed(self) -> Array:
        """How far the robot passed from each way-point (M,) [m]."""
        assert self.take.p_WB is not None
        xy = self.take.p_WB[:, :2]
        return np.array([np.hypot(*(xy - p).T).min() for p in self.path.points])

    def mean_off(self, period: float) -> Array:
        """Heading error (K,) [rad], mean over the `period` [s] that ends with each cycle; NaN for the start. A gait's heading
        sways within a cycle, which no decision once a cycle can change."""
        assert self.take.quat_WB is not None
        assert self.take.p_WB is not None
        yaw = np.unwrap(heading(self.take.quat_WB))
        begin = self.take.time[0] + self._first_end()
        out = np.full(len(self.poses), np.nan)
        for k in range(1, len(self.poses)):
            inside = (self.take.time > begin + (k - 1) * period + 1e-9) & (self.take.time <= begin + k * period + 1e-9)
            near = self.along[k - 1]
            errors = []
            for xy, angle in zip(self.take.p_WB[inside][::5, :2], yaw[inside][::5]):
                near, _ = self.path.project(xy, near)
                errors.append(_wrap(angle - self.path.heading(near)))
            out[k] = np.mean(errors)
        return out

    def _first_end(self) -> float:
        """When the start section ends [s after the take's first row]: the row whose pose is the first one judged."""
        assert self.take.p_WB is not None
        far = np.hypot(*(self.take.p_WB[:, :2] - self.poses[0, :2]).T)
        return float(self.take.time[np.argmin(far)] - self.take.time[0])


def drive(walk: Walk, path: WayPath, controller: CycleController, most_cycles: int = 200, steer: bool = True,
          progress: Progress = lambda what, done: None, watch: Watch | None = None) -> Driven:
    """Walks along `path`. steer: False plays the straight gait instead (open loop), for comparison.

    The robot starts from rest at the origin, heading along x. It stops at the end of the path, after `most_cycles`, when it
    falls, or when the cameras have lost it. The stop section is played, unless it fell or was stopped by someone else; as a turn,
    a stop acts one cycle after it was decided.
    """
    rows: list[list[float]] = []
    try:
        reason = _walk(walk, path, controller, most_cycles, steer, rows, progress, watch)
        if reason != FELL:
            walk.end()
    except StoppedError as e:
        reason = e.reason
    columns = np.array(rows).reshape(-1, 12).T
    turns, sides, left, off, along, biases = columns[6:]
    return Driven(path, columns[:3].T, columns[3:6].T, turns, sides, left, off, along, biases, reason, walk.take())


def _walk(walk: Walk, path: WayPath, controller: CycleController, most_cycles: int, steer: bool, rows: list[list[float]],
          progress: Progress, watch: Watch | None) -> str:
    """Start and cycles, up to the last one before the stop; a row for each end of a cycle. Returns why it ends."""
    context, seen = controller.CreateDefaultContext(), walk.begin()
    played = committed = STRAIGHT  # the cycle that has ended, and the next, which is on the controller already
    near, reason = 0.0, ""
    for k in range(most_cycles + 1):
        if seen.fell:
            return FELL
        left = math.nan
        if np.isfinite(seen.pose).all():
            near, left = path.project(seen.pose[:2], near)
        after, bias, ends = _decide(controller, context, seen.captured) if steer else (STRAIGHT, math.nan, "")
        off = _wrap(seen.pose[2] - path.heading(near))
        rows.append([*seen.pose, *seen.captured, played.turn, played.side, left, off, near, bias])
        progress(f"cycle {k + 1}", min(near / path.length, 1.0))
        if watch is not None:
            watch(seen, controller.planned_points(context) if steer else np.empty((0, 2)))
        if reason:
            break
        if not steer and near + 1.5 * controller.map.ahead >= path.length:
            ends = END
        reason = ends or (f"{most_cycles} cycles" if k == most_cycles - 1 else "")
        seen = walk.cycle(committed, None if reason else after)
        played, committed = committed, after
    return reason


def _decide(controller: CycleController, context: Context, seen: Array) -> tuple[Steer, float, str]:
    """One update: the steering of the cycle after next, the estimated bias [rad per cycle], and the reason to stop or ""."""
    controller.GetInputPort("pose").FixValue(context, seen)
    context.SetDiscreteState(0, controller.EvalUniquePeriodicDiscreteUpdate(context).value(0))
    turn, side, state, stop, lost = (np.asarray(controller.GetOutputPort(n).Eval(context))
                                     for n in ("turn", "side", "state", "stop", "lost"))
    why = "lost by the cameras" if lost[0] else END
    return Steer(float(turn[0]), float(side[0])), float(state[3]), why if stop[0] else ""


def _wrap(angle: float) -> float:
    return float(np.arctan2(np.sin(angle), np.cos(angle)))
