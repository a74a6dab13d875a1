"""The recordings of a robot: stand, sway and walk before cameras, or logs of its own joints; and the takes to be predicted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from studies.concealed_effects.robots import Robot
from studies.other_engine.excitation import MotionRows, varied_walk
from studies.other_engine.firmware import read_rows
from studies.other_engine.make_session import TakePlan, plan_takes
from studies.other_engine.player import Rollout, play
from workbench.motion.commands import Commands
from workbench.robot import RobotModel, data_file
from workbench.types import Array

LOG_RATE = 100.0
LOG_NOISE = float(np.deg2rad(0.05))
LOG_COUNT = float(np.deg2rad(360 / 4096))
REST = 0.5
"""Seconds of rest at the start of a log."""


@dataclass(frozen=True)
class LogPlan:
    """A log to record: goals (N, n) [rad] by joint at times (N,) [s], from rest in neutral on."""

    name: str
    time: Array
    joints: tuple[str, ...]
    goals: Array
    predict: bool = False

    def commands(self) -> Commands:
        """Each row's goals, at once."""
        shape = self.goals.shape
        return Commands(self.time - self.time[0], self.joints, self.goals, np.zeros(shape), np.ones(shape, dtype=bool),
                        float(self.time[-1] - self.time[0]), np.full(len(self.time), -1))


def walk_of(rng: np.random.Generator) -> MotionRows:
    """The ROBOTIS walk, a little slower or faster, wider or narrower."""
    walk = MotionRows(*read_rows(data_file("robotis_walk.csv")))
    rows = varied_walk(walk, float(rng.uniform(0.97, 1.15)), float(rng.uniform(0.85, 1.05)))
    return replace(rows, times=np.round(rows.times, 4), angles=np.round(rows.angles, 2))


def filmed_takes(rng: np.random.Generator) -> list[TakePlan]:
    """Three to learn from, two to foretell."""
    return plan_takes(walk_of(rng), rng)


def logged_takes(model: RobotModel, rng: np.random.Generator) -> list[LogPlan]:
    """Slow waves, quick waves and steps to learn from; other waves and other steps to foretell."""
    return [LogPlan("slow", *_waves(model, rng, 0.25, 9.0)), LogPlan("quick", *_waves(model, rng, 0.9, 6.0)),
            LogPlan("steps", *_steps(model, rng, 6.0)), LogPlan("hidden_waves", *_waves(model, rng, 0.5, 6.0), predict=True),
            LogPlan("hidden_steps", *_steps(model, rng, 5.0), predict=True)]


def _waves(model: RobotModel, rng: np.random.Generator, rate: float, length: float) -> tuple[Array, tuple[str, ...], Array]:
    """A sum of two sines for each joint, that grows out of rest."""
    t = np.arange(round((REST + length) * LOG_RATE) + 1) / LOG_RATE
    s = np.maximum(t - REST, 0.0)
    goals = [np.deg2rad(rng.uniform(25, 45)) * np.sin(2 * np.pi * rate * rng.uniform(0.8, 1.2) * s)
             + np.deg2rad(rng.uniform(6, 14)) * np.sin(2 * np.pi * rate * rng.uniform(1.9, 2.6) * s) for _ in model.joints]
    return t, model.joints, np.column_stack(goals)


def _steps(model: RobotModel, rng: np.random.Generator, length: float) -> tuple[Array, tuple[str, ...], Array]:
    """Holds and jumps at random."""
    t = np.arange(round((REST + length) * LOG_RATE) + 1) / LOG_RATE
    goals = np.zeros((len(t), len(model.joints)))
    for c in range(len(model.joints)):
        edges = REST + np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 1.0, 30))])
        levels = np.deg2rad(rng.uniform(-50, 50, len(edges)))
        at = np.searchsorted(edges, t, side="right") - 1
        goals[:, c] = np.where(at >= 0, levels[at], 0.0)
    return t, model.joints, goals


def play_log(model: RobotModel, plan: LogPlan, timestep: float, chance: int) -> Rollout:
    """The robot on its base, from the log's first row on."""
    commands = plan.commands()
    return play(model, commands, commands.end, lead=0.0, base="fixed", timestep=timestep, chance=chance)


def log_rows(run: Rollout, plan: LogPlan, rng: np.random.Generator) -> tuple[Array, Array]:
    """Positions and velocities (N, n) [rad, rad/s] as the servos report them: noise, and counts of 4096 to the turn."""
    step = run.time[1] - run.time[0]
    at = np.clip(np.round((plan.time - plan.time[0] - run.time[0]) / step).astype(int), 0, len(run.time) - 1)
    noisy = run.sensed[at] + LOG_NOISE * rng.standard_normal(plan.goals.shape)
    return np.round(noisy / LOG_COUNT) * LOG_COUNT, run.v[at]


def log_csv(plan: LogPlan, position: Array, velocity: Array | None = None, start_only: bool = False) -> str:
    """Text of a joint log; start_only: the commands of a prediction, with the measured state in the first row alone."""
    kinds = ("goal", "enabled", "position", *(() if velocity is None else ("velocity",)))
    header = ["time", *(f"{kind}.{j}" for kind in kinds for j in plan.joints)]
    lines = [",".join(header)]
    for k, t in enumerate(plan.time):
        cells = [f"{t:.4f}", *(f"{x:.5f}" for x in np.rad2deg(plan.goals[k])), *("1" for _ in plan.joints)]
        measured = [*np.rad2deg(position[k]), *(() if velocity is None else np.rad2deg(velocity[k]))]
        cells += ["" if start_only and k else f"{x:.5f}" for x in measured]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def is_logged(robot: Robot) -> bool:
    """Whether the robot logs its joints and is not filmed."""
    return not robot.rigid_bodies
