"""Plays a motion with a station's drive."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import Context

from workbench.motion import Motion, interpolate_motion
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation.batch import Job
from workbench.simulation.config import SimulationConfig
from workbench.simulation.rollout import Simulation
from workbench.types import Array

LEAD = 0.3
"""Rest before the first command [s]."""


def motion_job(model: RobotModel, config: SimulationConfig, motion: Motion, cycles: int | None = None,
               duration: float | None = None) -> Job:
    """A motion played `cycles` times (None: as often as its file says), or for `duration` [s] of that, after `LEAD` of rest.

    A servo gets the firmware's commands, rounded as there. An ideal joint follows the angles themselves, by a smooth cubic, as
    in the thesis's inverse dynamics.
    """
    cycles = motion.often(cycles)
    commands = motion.commands(cycles)
    trajectory = smooth_trajectory(model, config, motion, cycles) if config.drive == "ideal" else None
    return Job(model, config, commands, commands.end if duration is None else duration, LEAD, trajectory, name=motion.name)


def smooth_trajectory(model: RobotModel, config: SimulationConfig, motion: Motion, cycles: int) -> tuple[Array, Array]:
    """Times (N,) [s] and angles (N, n) [rad] in the model's order of joints; those that the motion lacks at zero."""
    smooth = interpolate_motion(motion, cycles, step=max(config.time_step, 1e-3))
    angles = np.zeros((len(smooth.time), len(model.joints)))
    for joint in smooth.joints:
        angles[:, model.joints.index(joint)] = smooth.q[:, smooth.column(joint)]
    return smooth.time, angles


def play_motion(simulation: Simulation, motion: Motion, cycles: int | None = None,
                progress: Callable[[float], None] | None = None) -> Take:
    """The take of `motion_job` on a station that exists. progress: called with the share of the time that is done, 0 to 1."""
    job = motion_job(simulation.model, simulation.config, motion, cycles)
    assert job.duration is not None
    end = job.lead + job.duration

    def report(context: Context) -> None:
        assert progress is not None
        progress(context.get_time() / end)

    if progress is not None:
        simulation.simulator.set_monitor(report)
    try:
        return simulation.run(job.commands, job.duration, job.lead, trajectory=job.trajectory, name=job.name)
    finally:
        simulation.simulator.clear_monitor()
