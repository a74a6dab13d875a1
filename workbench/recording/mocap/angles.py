"""Joint angles and the base's pose from repaired tracks, through the kinematic tree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.recording import quaternions as quat
from workbench.recording.mocap.tracks import Tracks, relative_rotation, seen_joints, turn_quaternion, turn_vectors
from workbench.robot import RobotModel
from workbench.types import Array


@dataclass(frozen=True)
class Angles:
    """joints: n names. q: (N, n) [rad] since the neutral pose, NaN where unseen. off_axis: (N, n, 3) [rad].
    seconds_squared: (N, n) as in Tracks, of the two bodies together."""

    joints: tuple[str, ...]
    q: Array
    off_axis: Array
    seconds_squared: Array
    problems: tuple[str, ...]


def joint_angles(tracks: Tracks, model: RobotModel, yaw: float, base: str) -> Angles:
    """Each joint's angle is the twist about its axis of the child body's rotation relative to the parent's (thesis, 5.4 and
    6.7); the remainder, the swing across the axis, is `off_axis`, turned from the capture's axes into the base's."""
    joints, problems = seen_joints(tracks.assets, model, base)
    n = len(tracks.time)
    q, off, reach = np.full((n, len(joints)), np.nan), np.full((n, len(joints), 3), np.nan), np.zeros((n, len(joints)))
    for c, joint in enumerate(joints):
        relative = relative_rotation(tracks, joint)
        q[:, c], swing = quat.swing_twist(relative, turn_vectors(joint.axis, yaw))
        off[:, c] = turn_vectors(swing, -yaw)
        rows = [r for r in (joint.parent, joint.child) if r is not None]
        reach[:, c] = np.sum(tracks.seconds_squared[rows], axis=0)
    return Angles(tuple(j.name for j in joints), q, off, reach, tuple(problems))


def angle_sigma(angles: Angles, noise: Array, rate: float) -> Array:
    """Standard deviation of each sample (N, n) [rad]: the noise (n,) at rest, and in filled samples the error of a straight
    line under the joint's own angular acceleration a, a t(T - t)/2."""
    step = max(1, round(0.025 * rate))
    q = angles.q
    sigma = np.broadcast_to(noise, q.shape).copy()
    if len(q) > 2 * step and angles.seconds_squared.any():
        bend = (q[2 * step:] - 2 * q[step:-step] + q[:-2 * step]) * (rate / step) ** 2
        mean_square = np.nanmean(np.square(bend), axis=0) if np.isfinite(bend).any() else np.zeros(q.shape[1])
        acceleration = np.sqrt(np.maximum(mean_square - 6 * noise**2 * (rate / step) ** 4, 0))
        sigma = np.hypot(sigma, acceleration * angles.seconds_squared / 2)
    return np.where(np.isfinite(q), sigma, np.nan)


def base_row(tracks: Tracks, model: RobotModel) -> int | None:
    """Row of the body that is the base link; None if it was not tracked."""
    for i, asset in enumerate(tracks.assets):
        if model.rigid_bodies.get(asset) == model.base:
            return i
    return None


def in_world(tracks: Tracks, yaw: float, origin: Array) -> tuple[Array, Array]:
    """p (A, N, 3) and q (A, N, 4) in the take's world: x along the first heading, its origin under the base's at rest, on the
    capture's floor."""
    return (turn_vectors(tracks.p - np.array([origin[0], origin[1], 0.0]), -yaw), turn_quaternion(tracks.q, -yaw))
