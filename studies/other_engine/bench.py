"""Speed and accuracy of MuJoCo on the same robot: the reference of the workbench's bench.

Here MuJoCo runs as fast as it can: the whole rollout in one call of its C code (`mujoco.rollout`), the servo law made of
MuJoCo's own actuators (`to_mjcf(..., drives=True)`) and no Python between steps. `play`, whose servo is in Python, is slower.
"""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco.rollout import rollout
from numpy.typing import NDArray

from studies.other_engine.description import describe
from studies.other_engine.mjcf import compile_model
from studies.other_engine.player import play
from studies.other_engine.servo import ServoBank
from workbench.motion.commands import Commands
from workbench.robot import RobotModel
from workbench.types import Array

SETTLE = 2.0


@dataclass(frozen=True)
class Race:
    """MuJoCo at one step [s]: joint error [rad RMS over joints and time] against the converged rollout, and its speed."""

    timestep: float
    error: float
    steps_per_second: float

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds per second."""
        return self.steps_per_second * self.timestep


class NativePlayer:
    """The robot in MuJoCo alone, at one step. Built once, run many times; a run starts from the settled neutral pose."""

    def __init__(self, model: RobotModel, commands: Commands, duration: float, base: str, timestep: float) -> None:
        description = describe(model.path)
        servos = ServoBank([model.servo(j) for j in description.joints])
        self.joints = description.joints
        self.time: Array = timestep * np.arange(1.0, round(duration / timestep) + 1)
        """Times of the states that `run` returns (N,) [s], 0 = first command."""
        self._model = compile_model(description, servos, model.ground, base, timestep, drives=True)
        self._data = mujoco.MjData(self._model)
        self._columns = 1 + np.array([self._model.joint(j).qposadr[0] for j in self.joints])  # the state begins with time
        at_rest = np.zeros((round(SETTLE / timestep), self._model.nu))
        self._start = self._advance(self._state(), at_rest)[-1]
        # The drives come in the joints' order; each of a joint's actuators gets the same reference. It does not depend on
        # the robot, as long as torque stays enabled.
        reference = commands.reordered(self.joints).reference(np.asarray(self.time - timestep, dtype=float))
        self._control = np.ascontiguousarray(reference[:, self._joint_of_actuator()])

    def run(self) -> Array:
        """Joint angles (N, n) [rad] at `time`."""
        return np.asarray(self._advance(self._start, self._control)[:, self._columns], dtype=float)

    def _joint_of_actuator(self) -> NDArray[np.int_]:
        names = [self._model.joint(self._model.actuator_trnid[i, 0]).name for i in range(self._model.nu)]
        return np.array([self.joints.index(name) for name in names])

    def _state(self) -> Array:
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        state = np.empty(mujoco.mj_stateSize(self._model, kind))
        mujoco.mj_getState(self._model, self._data, state, kind)
        return state

    def _advance(self, state: Array, control: Array) -> Array:
        states, _ = rollout(self._model, self._data, state[None], control[None])
        return np.asarray(states[0], dtype=float)


def joint_error(time: Array, q: Array, reference_time: Array, reference: Array) -> float:
    """RMS over joints and time [rad] of q (N, n) at `time` against a finer rollout (M, n), interpolated."""
    exact = np.column_stack([np.interp(time, reference_time, column) for column in reference.T])
    return float(np.sqrt(np.mean(np.square(q - exact))))


def race(
    model: RobotModel, commands: Commands, duration: float, base: str = "free",
    timesteps: Sequence[float] = (5e-4, 1e-3, 2e-3, 3e-3, 4e-3, 5e-3), converged: float = 1e-4, repeats: int = 3,
) -> list[Race]:
    """MuJoCo's error and speed at each step [s]; errors are against its own rollout at the step `converged`.

    Only the rollout is timed, the best of `repeats`, with the model built and settled. On a free base keep the duration
    under a second: after that walking has amplified every difference, and the error no longer tells of the step.
    """
    finest = NativePlayer(model, commands, duration, base, converged)
    exact = finest.run()
    races = []
    for timestep in timesteps:
        player = NativePlayer(model, commands, duration, base, timestep)
        seconds = []
        for _ in range(repeats):
            begin = clock.perf_counter()
            q = player.run()
            seconds.append(clock.perf_counter() - begin)
        error = joint_error(player.time, q, finest.time, exact)
        races.append(Race(timestep, error, len(player.time) / min(seconds)))
    return races


def fastest_within(races: Sequence[Race], error: float) -> Race:
    """The race of the highest real-time factor whose joint error is at most `error` [rad]; ValueError if there is none."""
    good = [r for r in races if r.error <= error]
    if not good:
        raise ValueError(f"no step is as exact as {np.rad2deg(error):.4f} deg; the best is "
                         f"{np.rad2deg(min(r.error for r in races)):.4f} deg: try finer steps")
    return max(good, key=lambda r: r.real_time_factor)


def python_servo_speed(model: RobotModel, commands: Commands, duration: float, base: str, timestep: float) -> float:
    """Steps per second of `play`, the servo in Python, with its settling and everything that it records."""
    begin = clock.perf_counter()
    steps = len(play(model, commands, duration, lead=0.0, base=base, timestep=timestep, settle=SETTLE).time)
    return (steps + SETTLE / timestep) / (clock.perf_counter() - begin)
