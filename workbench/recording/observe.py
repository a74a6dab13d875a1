"""A simulated take as the cameras would have seen it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.recording import quaternions as quat
from workbench.recording.recording import Measurement
from workbench.recording.take import BodyTrack, Take
from workbench.recording.tracks import capture_axes, turned, turned_quaternion
from workbench.robot import RobotModel

Array = NDArray[np.float64]


def observe(take: Take, measurement: Measurement, model: RobotModel, time: Array) -> tuple[Take, dict[str, BodyTrack]]:
    """Passes a simulated take (absolute angles, time 0 = first command) through the measurement of a recorded one.

    Returns the take on the recording's clock at `time` (N,) [s], its angles and the base's rotation zeroed at its own settled
    pose and its base's origin at rest where the recorded one stood, as in `take_from_recording`; and the path of each asset
    that has a pivot, in the capture's axes. Before the simulation's first instant the robot stands still; after its last, NaN.
    """
    m = measurement
    start = 0.0 if np.isnan(take.starts_at) else take.starts_at
    at = np.asarray(time, dtype=float) - m.starts_at + start
    seen = replace(take.resampled(np.maximum(at, take.time[0])), time=np.asarray(time, dtype=float), starts_at=m.starts_at)
    level = np.broadcast_to([1.0, 0, 0, 0], (len(at), 4))
    p_WB = np.zeros((len(at), 3)) if seen.p_WB is None else seen.p_WB
    quat_WB = level if seen.quat_WB is None else seen.quat_WB
    q0, p0, quat0 = _at_rest(take)
    bodies = _bodies(seen.q, p_WB, quat_WB, (q0, p0, quat0), take.joints, m, model)
    zeroed = replace(
        seen, q=seen.q - q0, zeroed=True, p_WB=p_WB - p0 + np.array([0, 0, m.origin[2]]),
        quat_WB=quat.multiply(quat_WB, quat.conjugate(quat0)),
        bodies={a: BodyTrack(turned(b.p - [m.origin[0], m.origin[1], 0.0], -m.yaw), turned_quaternion(b.quat, -m.yaw))
                for a, b in bodies.items()})
    return zeroed, {a: BodyTrack(capture_axes(b.p), np.concatenate([b.quat[:, :1], capture_axes(b.quat[:, 1:])], axis=1))
                    for a, b in bodies.items()}


def _at_rest(take: Take) -> tuple[Array, Array, Array]:
    """Mean angles (n,), base position (3,) and rotation (4,) before the first command, or at the first instant."""
    rest = take.resting if take.resting.any() else np.arange(len(take)) == 0
    p = np.zeros(3) if take.p_WB is None else take.p_WB[rest].mean(axis=0)
    turn = np.array([1.0, 0, 0, 0]) if take.quat_WB is None else quat.mean(take.quat_WB[rest])
    return take.q[rest].mean(axis=0), p, turn


def _bodies(q: Array, p_WB: Array, quat_WB: Array, rest: tuple[Array, Array, Array], joints: tuple[str, ...], m: Measurement,
            model: RobotModel) -> dict[str, BodyTrack]:
    """Paths in the capture's axes turned into the model's. The last row of each array is the rest."""
    k = model.kinematics
    poses = k.forward(np.vstack([q, rest[0]]), joints)
    R_WB = quat.matrix(np.vstack([quat_WB, rest[2]]))
    p_B, R_B = poses[model.base]
    out = {}
    for asset, pivot in m.pivots.items():
        p, R = poses[model.rigid_bodies[asset]]
        R_BL = np.einsum("nji,njk->nik", R_B, R)
        p_BP = np.einsum("nji,nj->ni", R_B, p - p_B) + R_BL @ pivot
        R_WL = R_WB @ R_BL
        since_rest = R_WL[:-1] @ R_WL[-1].T
        p_W = p_WB + np.einsum("nij,nj->ni", R_WB[:-1], p_BP[:-1]) - rest[1]
        good = np.isfinite(since_rest).all(axis=(1, 2))
        turn = np.full((len(q), 4), np.nan)
        if good.any():
            turn[good] = quat.from_matrix(since_rest[good])
        out[asset] = BodyTrack(turned(p_W, m.yaw) + m.origin, quat.continuous(turned_quaternion(turn, m.yaw))[0])
    return out
