"""A run in MuJoCo as a take, for whoever wants to compare it with one of the workbench's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from studies.other_engine.player import play
from workbench.motion.commands import Commands
from workbench.recording.take import Take
from workbench.robot import RobotModel

EVERY = 2
"""Steps of half a millisecond from row to row."""


def mujoco_take(model: RobotModel, commands: Commands, seconds: float) -> Take:
    """Commands played on the free robot for so long after the first of them; 0.3 s of rest before it.

    The torque is the motor's less viscous friction; Coulomb friction is MuJoCo's own and not in it."""
    run = play(model, commands, seconds)
    rows = slice(0, None, EVERY)
    order = [run.joints.index(j) for j in model.joints]
    w = run.qpos[rows, 3:7]
    first = np.searchsorted(run.time[rows], 0.0)
    viscous = np.array([model.servo(j).viscous_friction for j in model.joints])
    v = run.v[rows][:, order]
    take = Take(name="MuJoCo", source="simulation", time=run.time[rows], joints=model.joints, q=run.q[rows][:, order],
                starts_at=0.0, v=v, p_WB=run.qpos[rows, :3].copy(), quat_WB=w.copy(),
                torque=run.torque[rows][:, order] - viscous * v, contact={}, commands=commands)
    assert take.p_WB is not None
    return replace(take, p_WB=take.p_WB - np.array([*take.p_WB[first, :2], 0.0]))
