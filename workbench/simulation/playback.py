"""Playback of a take: the thesis's animation, without dynamics."""

from __future__ import annotations

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform
from pydrake.planning import RobotDiagram
from pydrake.systems.framework import Context

from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.servo.bank import servo_joints
from workbench.types import Array


def play_back(diagram: RobotDiagram, context: Context, model: RobotModel, base: str, take: Take) -> Take:
    """Poses the model at each frame of a take, joints it did not see in neutral, gaps bridged, velocities by differences.

    Publishes each pose, so that a visualizer on the diagram shows it."""
    q = np.zeros((len(take), len(model.joints)))
    for i, joint in enumerate(model.joints):
        if joint in take.joints:
            q[:, i] = _bridge(take.time, take.q[:, take.column(joint)])
    p_WB, quat_WB = bridged_base(take)
    plant = diagram.plant()
    plant_context = diagram.GetMutableSubsystemContext(plant, context)
    joints = servo_joints(plant, model)
    for i, t in enumerate(take.time):
        context.SetTime(float(t - take.time[0]))
        for joint, angle in zip(joints, q[i]):
            joint.set_angle(plant_context, angle)
        if base == "free":
            X_WB = RigidTransform(Quaternion(wxyz=quat_WB[i]), p_WB[i])
            plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context, plant.GetBodyByName(model.base), X_WB)
        diagram.ForcedPublish(context)
    return Take(name=take.name, source="playback", time=take.time, joints=model.joints, q=q, starts_at=take.starts_at,
                zeroed=take.zeroed, base=take.base, v=np.asarray(np.gradient(q, take.time, axis=0)), p_WB=p_WB, quat_WB=quat_WB,
                bodies=take.bodies, commands=take.commands)


def bridged_base(take: Take) -> tuple[Array, Array]:
    """Base path of a take, p_WB (N, 3) [m] and quat_WB (N, 4) wxyz, gaps bridged; at the origin, level, where it was not seen."""
    n = len(take)
    if take.p_WB is None or take.quat_WB is None:
        return np.zeros((n, 3)), np.tile([1.0, 0, 0, 0], (n, 1))
    p = np.column_stack([_bridge(take.time, c) for c in take.p_WB.T])
    quat = np.column_stack([_bridge(take.time, c) for c in take.quat_WB.T])
    return p, quat / np.linalg.norm(quat, axis=1, keepdims=True)


def _bridge(time: Array, values: Array) -> Array:
    good = np.isfinite(values)
    return np.interp(time, time[good], values[good]) if good.any() else np.zeros_like(values)
