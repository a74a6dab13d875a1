"""A robot whose build is not the model's: where its links are, and what cameras see of its joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.effects.apply import Physics
from workbench.recording import quaternions as quat
from workbench.recording.body_track import BodyTrack
from workbench.robot import Kinematics, RobotModel
from workbench.types import Array


@dataclass(frozen=True)
class Joints:
    """Angles q and velocities v (N, n) [rad, rad/s] of links against their parents, and off_axis (N, n, 3) as in Take."""

    q: Array
    v: Array
    off_axis: Array


class Structure:
    """Play, springs and lengths added to the model's kinematics. `joints`: all that turn, servos' and those put between."""

    def __init__(self, model: RobotModel, physics: Physics) -> None:
        assert physics.description is not None
        self._model, self._stages = model, physics.stages
        self.kinematics = Kinematics.from_text(physics.description, model.path)
        self.joints = self.kinematics.joints

    def links(self, q: Array, p_WB: Array, quat_WB: Array) -> dict[str, BodyTrack]:
        """Poses in W of the model's links. q: (N, joints) in self.joints' order; p_WB (N, 3), quat_WB (N, 4): of the base."""
        poses = self.kinematics.forward(q)
        p_B, R_B = poses[self._model.base]
        R_WB = quat.matrix(quat_WB)
        out = {}
        for link in self._model.kinematics.links:
            p, R = poses[link]
            R_WR = np.einsum("nij,nkj->nik", R_WB, R_B)
            quats = quat.continuous(quat.from_matrix(R_WR @ R))[0]
            out[link] = BodyTrack(p_WB + np.einsum("nij,nj->ni", R_WR, p - p_B), quats)
        return out

    def seen(self, q: Array, v: Array) -> Joints:
        """The model's joints as the links turn. q, v: (N, joints) in self.joints' order.

        Between servo and link turns S, the product of the stages. With S = swing twist about the servo's axis, and the servo's
        own rotation T, T S = (T swing T^-1) T twist: the angle seen is the servo's plus that of twist, off the axis is the
        swing, carried round by the servo.
        """
        k, nominal = self.kinematics, self._model.kinematics
        column = {j: i for i, j in enumerate(self.joints)}
        own = [column[j] for j in self._model.joints]
        angle, rate = q[:, own], v[:, own]
        off = np.zeros((*angle.shape, 3))
        neutral = nominal.forward(np.zeros((1, len(nominal.joints))))
        R_BR = neutral[self._model.base][1][0].T
        for i, joint in enumerate(self._model.joints):
            f = k.frames[joint]
            turn = np.tile([1.0, 0, 0, 0], (len(q), 1))
            for stage in self._stages.get(joint, ()):
                axis = k.frames[stage].axis
                turn = quat.multiply(turn, quat.about(axis, q[:, column[stage]]))
                rate[:, i] += axis @ f.axis * v[:, column[stage]]
            twist, swing = quat.swing_twist(turn, f.axis)
            servo = quat.matrix(quat.about(f.axis, angle[:, i]))
            R_BF = R_BR @ neutral[f.parent][1][0] @ f.X_PF_R
            off[:, i] = np.einsum("nij,nj->ni", R_BF @ servo, swing)
            angle[:, i] += twist
        return Joints(angle, rate, off)

    def servo_angles(self, link_angles: Array, q: Array) -> Array:
        """Angles of servos (n,) [rad] for links at `link_angles` (n,), with the other joints as in q (joints,)."""
        at = np.array(q, dtype=float)
        at[[self.joints.index(j) for j in self._model.joints]] = 0.0
        return np.asarray(link_angles - self.seen(at[None], np.zeros((1, len(at)))).q[0])
