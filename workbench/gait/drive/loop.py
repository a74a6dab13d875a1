"""The closed loop in simulation: a robot that is not the model, cameras with noise and lost frames, one decision a cycle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.systems.framework import Context

from workbench.compare.metrics import heading
from workbench.gait.drive.controller import CycleController
from workbench.gait.drive.family import GaitFamily
from workbench.gait.drive.path import WayPath
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.stepped import SteppedRun
from workbench.types import Array, Progress

FALLEN = math.cos(math.radians(45))
"""Upward component of the base's z axis below which the robot lies."""
SETTLED = 0.8
"""Distance along the path [m] from which errors are judged: with two cycles of delay and an unknown bias the first part is open
loop."""


@dataclass(frozen=True)
class Cameras:
    """Noise of a captured heading [rad] and position [m], and the share of cycles without a pose."""

    heading: float = 0.0021
    position: float = 1e-4
    lost: float = 0.0


@dataclass(frozen=True, eq=False)
class Driven:
    """What came of it. poses (K, 3): x, y [m], heading [rad] at the end of each cycle, true; seen (K, 3): as captured; turns (K,)
    played in the cycle that ends there [rad per stance]; left (K,) [m], off (K,) [rad], along (K,) [m]: true errors from the
    path; bias (K,): estimated [rad per cycle], NaN if not steered. reason: why it stopped. take: the whole run."""

    path: WayPath
    poses: Array
    seen: Array
    turns: Array
    left: Array
    off: Array
    along: Array
    bias: Array
    reason: str
    take: Take

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Cycles whose errors are judged."""
        return np.asarray(self.along >= min(SETTLED, self.path.length / 2))

    def missed(self) -> Array:
        """How far the robot passed from each way-point (M,) [m]."""
        assert self.take.p_WB is not None
        xy = self.take.p_WB[:, :2]
        return np.array([np.hypot(*(xy - p).T).min() for p in self.path.points])


def drive(family: GaitFamily, robot: RobotModel, path: WayPath, controller: CycleController, cameras: Cameras | None = None,
          seed: int = 0, most_cycles: int = 200, steer: bool = True, progress: Progress = lambda what, done: None) -> Driven:
    """Walks `robot` along `path`. steer: False plays the straight gait instead (open loop), for comparison.

    The robot starts from rest at the origin, heading along x. It stops at the end of the path, after `most_cycles`, when it
    falls, or when the cameras have lost it; the gait's stop section is played unless it fell.
    """
    cameras, rng = cameras or Cameras(), np.random.default_rng(seed)
    period_ms, start_ms = round(1000 * family.period), round(1000 * family.table(0.0).start_seconds)
    config = SimulationConfig(time_step=1e-3, contact_period=0.0, log_period=math.gcd(period_ms, start_ms, 10) / 1000)
    run = Simulation(robot, config).stepped()
    run.send(family.start)
    run.advance(start_ms / 1000)
    context = controller.CreateDefaultContext()
    rows: list[list[float]] = []
    played = committed = near = 0.0  # turns of the cycle that has ended and of the next, which is on the controller already
    reason = f"{most_cycles} cycles"
    for k in range(most_cycles):
        pose = _pose(run)
        if not np.isfinite(pose).all():
            reason = "fell"
            break
        seen = _captured(pose, cameras, rng)
        near, left = path.project(pose[:2], near)
        after, bias, ends = _decided(controller, context, seen) if steer else (0.0, math.nan, False)
        rows.append([*pose, *seen, played, left, _wrapped(pose[2] - path.heading(near)), near, bias])
        progress(f"cycle {k + 1}", min(near / path.length, 1.0))
        if ends if steer else near + controller.map.ahead / 2 >= path.length:
            reason = "end of the path" if near + controller.map.ahead >= path.length else "lost by the cameras"
            break
        run.send(family.cycle(committed))
        run.advance(period_ms / 1000)
        played, committed = committed, after
    if reason != "fell":
        run.send(family.stop)
        run.advance(family.stop.end)
    columns = np.array(rows).T
    turns, left, off, along, bias = columns[6:]
    return Driven(path, columns[:3].T, columns[3:6].T, turns, left, off, along, bias, reason, run.take("driven"))


def _decided(controller: CycleController, context: Context, seen: Array) -> tuple[float, float, bool]:
    """One update: the turn of the cycle after next [rad], the estimated bias [rad per cycle], and whether to stop now."""
    controller.GetInputPort("pose").FixValue(context, seen)
    context.SetDiscreteState(0, controller.EvalUniquePeriodicDiscreteUpdate(context).value(0))
    turn, state, stop = (np.asarray(controller.GetOutputPort(name).Eval(context)) for name in ("turn", "state", "stop"))
    return float(turn[0]), float(state[3]), bool(stop[0])


def _pose(run: SteppedRun) -> Array:
    """x, y [m] and heading [rad]; NaN where the robot lies."""
    base = run.state.base
    assert base is not None
    _, x, y, _ = base.quat_WB
    if 1 - 2 * (x**2 + y**2) < FALLEN:
        return np.full(3, np.nan)
    return np.array([*base.p_WB[:2], float(heading(base.quat_WB[None])[0])])


def _captured(pose: Array, cameras: Cameras, rng: np.random.Generator) -> Array:
    noise = rng.normal(size=3) * [cameras.position, cameras.position, cameras.heading]
    return np.full(3, np.nan) if rng.random() < cameras.lost else pose + noise


def _wrapped(angle: float) -> float:
    return float(np.arctan2(np.sin(angle), np.cos(angle)))
