"""A motion played by the drive that a station has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.systems.framework import Context

from workbench.motion import Motion, interpolate_motion
from workbench.recording.take import Take
from workbench.simulation.rollout import Simulation


def play_motion(simulation: Simulation, motion: Motion, cycles: int = 1, lead: float = 0.3,
                progress: Callable[[float], None] | None = None) -> Take:
    """Plays a motion `cycles` times after `lead` [s] of rest.

    A servo gets the firmware's commands, rounded as there. An ideal joint follows the angles themselves, by a smooth cubic, as in
    the thesis's inverse dynamics. progress: called with the share of the time that is done, 0 to 1.
    """
    commands = motion.commands(cycles)
    end = lead + commands.end

    def report(context: Context) -> None:
        assert progress is not None
        progress(context.get_time() / end)

    if progress is not None:
        simulation.simulator.set_monitor(report)
    try:
        if simulation.config.drive != "ideal":
            return simulation.run(commands, lead=lead, name=motion.name)
        smooth = interpolate_motion(motion, cycles, step=max(simulation.config.time_step, 1e-3))
        angles = np.zeros((len(smooth.time), len(simulation.joints)))
        for joint in smooth.joints:
            angles[:, simulation.joints.index(joint)] = smooth.q[:, smooth.column(joint)]
        return simulation.run(commands, lead=lead, trajectory=(smooth.time, angles), name=motion.name)
    finally:
        simulation.simulator.clear_monitor()
