"""A simulated take as the cameras would have seen it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench.recording import quaternions as quat
from workbench.recording.body_track import BodyTrack
from workbench.recording.mocap.angles import base_row, joint_angles
from workbench.recording.mocap.tracks import Tracks, capture_axes, model_axes, turn_quaternion, turn_vectors
from workbench.recording.recording import Measurement
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.types import Array, Mask


def observe(take: Take, measurement: Measurement, model: RobotModel, time: Array) -> tuple[Take, dict[str, BodyTrack]]:
    """Passes a simulated take (absolute angles, time 0 = first command) through the measurement of a recorded one.

    Returns the take on the recording's clock at `time` (N,) [s], its angles and the base's rotation zeroed at its own settled
    pose and its base's origin at rest where the recorded one stood, as in `take_from_recording`; and the path of each asset
    that has a pivot, in the capture's axes. Before the simulation's first instant the robot stands still; after its last, NaN.

    Bodies are where the take's `links` are, else where the model's kinematics has them. Joint angles are read off the bodies just
    as from a recording, as a robot that leans or droops at rest turns about axes that lean; joints between bodies that are not
    tracked keep the rollout's own angle, and have NaN off the axis.
    """
    m = measurement
    start = 0.0 if np.isnan(take.starts_at) else take.starts_at
    at = np.asarray(time, dtype=float) - m.starts_at + start
    seen = replace(take.resampled(np.maximum(at, take.time[0])), time=np.asarray(time, dtype=float), starts_at=m.starts_at)
    level = np.broadcast_to([1.0, 0, 0, 0], (len(at), 4))
    p_WB = np.zeros((len(at), 3)) if seen.p_WB is None else seen.p_WB
    quat_WB = level if seen.quat_WB is None else seen.quat_WB
    q0, p0, quat0 = _at_rest(take)
    if take.links:
        poses = _given_poses(seen, take, m, model)
    else:
        poses = _model_poses(np.vstack([seen.q, q0]), np.vstack([p_WB, p0]), np.vstack([quat_WB, quat0]), take.joints, m, model)
    bodies = _bodies(poses, p0, m)
    zeroed = replace(
        seen, q=seen.q - q0, zeroed=True, p_WB=p_WB - p0 + np.array([0, 0, m.origin[2]]),
        quat_WB=quat.multiply(quat_WB, quat.conjugate(quat0)), servo_q=None, links={},
        off_axis=None if seen.off_axis is None else seen.off_axis - _rest_off_axis(take),
        bodies={a: BodyTrack(turn_vectors(b.p - [m.origin[0], m.origin[1], 0.0], -m.yaw), turn_quaternion(b.quat, -m.yaw))
                for a, b in bodies.items()})
    if bodies:
        zeroed = _as_bodies_say(zeroed, bodies, m, model)
    return zeroed, {a: BodyTrack(capture_axes(b.p), np.concatenate([b.quat[:, :1], capture_axes(b.quat[:, 1:])], axis=1))
                    for a, b in bodies.items()}


def _resting(take: Take) -> Mask:
    """Frames before the first command, or the first instant."""
    return take.resting if take.resting.any() else np.arange(len(take)) == 0


def _at_rest(take: Take) -> tuple[Array, Array, Array]:
    """Mean joint angles (n,), base position (3,) and rotation (4,) before the first command, or at the first instant."""
    rest = _resting(take)
    p = np.zeros(3) if take.p_WB is None else take.p_WB[rest].mean(axis=0)
    turn = np.array([1.0, 0, 0, 0]) if take.quat_WB is None else quat.mean(take.quat_WB[rest])
    return take.q[rest].mean(axis=0), p, turn


def _rest_off_axis(take: Take) -> Array:
    assert take.off_axis is not None
    return np.asarray(take.off_axis[_resting(take)].mean(axis=0))


def _model_poses(q: Array, p_WB: Array, quat_WB: Array, joints: tuple[str, ...], m: Measurement,
                 model: RobotModel) -> dict[str, tuple[Array, Array]]:
    """p_WL (N + 1, 3) and R_WL (N + 1, 3, 3) by asset with a pivot, from the model's kinematics; the last row is the rest."""
    poses = model.kinematics.forward(q, joints)
    p_B, R_B = poses[model.base]
    R_WR = np.einsum("nij,nkj->nik", quat.matrix(quat_WB), R_B)
    out = {}
    for asset in m.pivots:
        p, R = poses[model.rigid_bodies[asset]]
        out[asset] = p_WB + np.einsum("nij,nj->ni", R_WR, p - p_B), R_WR @ R
    return out


def _given_poses(seen: Take, take: Take, m: Measurement, model: RobotModel) -> dict[str, tuple[Array, Array]]:
    """The same as `_model_poses`, from the poses of the take's links."""
    rest = _resting(take)
    out = {}
    for asset in m.pivots:
        link = model.rigid_bodies[asset]
        at, whole = seen.links[link], take.links[link]
        out[asset] = (np.vstack([at.p, whole.p[rest].mean(axis=0)]),
                      quat.matrix(np.vstack([at.quat, quat.mean(whole.quat[rest])])))
    return out


def _bodies(poses: dict[str, tuple[Array, Array]], p0: Array, m: Measurement) -> dict[str, BodyTrack]:
    """Paths in the capture's axes turned into the model's; p0 (3,): the base's origin at rest.

    An asset's frame is parallel to the capture's axes at rest, so its rotation is that of its link since rest. A turned
    frame is turned in its own axes, before that: from the right, so that the recording starts at the turn itself."""
    out = {}
    for asset, pivot in m.pivots.items():
        p_WL, R_WL = poses[asset]
        p_W = p_WL[:-1] + R_WL[:-1] @ pivot - p0
        since_rest = R_WL[:-1] @ R_WL[-1].T
        good = np.isfinite(since_rest).all(axis=(1, 2))
        turn = np.full((len(p_W), 4), np.nan)
        if good.any():
            turn[good] = quat.from_matrix(since_rest[good])
        turn = turn_quaternion(turn, m.yaw)
        if asset in m.frames:
            turn = quat.multiply(turn, frame_turn(asset, m))
        out[asset] = BodyTrack(turn_vectors(p_W, m.yaw) + m.origin, quat.continuous(turn)[0])
    return out


def frame_turn(asset: str, m: Measurement) -> Array:
    """The turn of an asset's frame (4,), in the capture's axes turned into the model's."""
    vector = model_axes(np.asarray(m.frames[asset], dtype=float))
    angle = float(np.linalg.norm(vector))
    return quat.about(vector / angle if angle else vector, angle)


def _as_bodies_say(zeroed: Take, bodies: dict[str, BodyTrack], m: Measurement, model: RobotModel) -> Take:
    """Joint angles, and the rotation of a base whose frame is turned, computed from the bodies as for a recording."""
    n = len(zeroed)
    tracks = Tracks(zeroed.time, float("nan"), tuple(bodies), np.stack([b.p for b in bodies.values()]),
                    np.stack([b.quat for b in bodies.values()]), np.zeros((len(bodies), n)), np.zeros(n, dtype=bool))
    angles = joint_angles(tracks, model, m.yaw, zeroed.base)
    q, off = zeroed.q.copy(), np.full((*zeroed.q.shape, 3), np.nan)
    columns = [zeroed.column(j) for j in angles.joints]
    q[:, columns], off[:, columns] = angles.q, angles.off_axis
    zeroed = replace(zeroed, q=q, off_axis=off)
    root = base_row(tracks, model)
    if root is None or tracks.assets[root] not in m.frames:
        return zeroed
    assert zeroed.p_WB is not None
    assert zeroed.quat_WB is not None
    asset = tracks.assets[root]
    quat_WB = zeroed.bodies[asset].quat
    shift = quat.matrix(zeroed.quat_WB) - quat.matrix(quat_WB)
    return replace(zeroed, quat_WB=quat_WB, p_WB=zeroed.p_WB + shift @ m.pivots[asset])
