"""Joints that carry a load in the recordings: effects that only a load shows cannot be identified at others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.dynamics.machine import Machine
from workbench.dynamics.trajectory import RobotTrajectory
from workbench.identify.options import PROBLEM
from workbench.identify.problem import TakeEvidence
from workbench.identify.rollouts.servo_logs import is_log
from workbench.robot import RobotModel
from workbench.types import Array


def unloaded_joints(model: RobotModel, evidence: Sequence[TakeEvidence]) -> set[str]:
    """Joints of a held robot that gravity loads by less than `PROBLEM.loaded` of their dry friction in every pose of these logs;
    empty where any take is not a servo log, as a floor or a hand may load any joint then."""
    if not evidence or not all(is_log(e) for e in evidence) or model.base != model.kinematics.root:
        return set()
    most = np.zeros(len(model.joints))
    for e in evidence:
        most = np.maximum(most, steady_loads(e.take.spec.robot(model), e))
    return {j for j, load in zip(model.joints, most) if load < PROBLEM.loaded * model.servo(j).coulomb_friction}


def steady_loads(model: RobotModel, e: TakeEvidence) -> Array:
    """The largest torque of gravity on each joint (n,) [N m] over a sample of the poses that a log shows. A joint that was not
    logged is taken to be at zero."""
    recorded = e.take.recorded
    rows = np.unique(np.linspace(0, len(recorded.time) - 1, PROBLEM.poses_sampled).astype(int))
    q = np.zeros((len(rows), len(model.joints)))
    for joint in recorded.joints:
        q[:, model.joints.index(joint)] = np.nan_to_num(recorded.q[rows, recorded.column(joint)])
    _, torques = Machine(model).demand(RobotTrajectory.at_rest(model.joints, q))
    return np.asarray(np.max(np.abs(torques), axis=0))
