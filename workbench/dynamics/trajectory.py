"""Motion of the whole robot over time, with the derivatives that inverse dynamics needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.dynamics.derivatives import Derivatives, differentiate
from workbench.files import InputError
from workbench.recording import quaternions
from workbench.types import Array


@dataclass(frozen=True)
class RobotTrajectory:
    """Joints and base of a robot over time; NaN where unseen.

    time: (N,) [s]. joints: (n,) names. q, v, a: (N, n) [rad, rad/s, rad/s²]. p_WB: (N, 3) [m] and quat_WB: (N, 4) wxyz, pose of
    the base link's frame in the world. V_WB, A_WB: (N, 6), spatial velocity and acceleration of B's origin in W, rotation
    first [rad/s, m/s; per s]. Joints that a model has and this lacks are held at zero.
    """

    time: Array
    joints: tuple[str, ...]
    q: Array
    v: Array
    a: Array
    p_WB: Array
    quat_WB: Array
    V_WB: Array
    A_WB: Array

    def __post_init__(self) -> None:
        N, n = len(self.time), len(self.joints)
        for key, width in (("q", n), ("v", n), ("a", n), ("p_WB", 3), ("quat_WB", 4), ("V_WB", 6), ("A_WB", 6)):
            if getattr(self, key).shape != (N, width):
                raise InputError(None, f"trajectory, {key}: expected shape {(N, width)}, got {getattr(self, key).shape}")
        if not np.isfinite(self.time).all() or np.any(np.diff(self.time) <= 0):
            raise InputError(None, "trajectory, time: expected finite times that increase")

    @staticmethod
    def at_rest(joints: tuple[str, ...], q: Array, p_WB: Array | None = None) -> RobotTrajectory:
        """N poses that are held, a second apart: q (N, n) [rad]; base level, at the origin if not given."""
        q = np.atleast_2d(np.asarray(q, dtype=float))
        N = len(q)
        return RobotTrajectory(
            np.arange(float(N)), joints, q, np.zeros_like(q), np.zeros_like(q),
            np.zeros((N, 3)) if p_WB is None else np.broadcast_to(p_WB, (N, 3)).astype(float),
            np.tile([1.0, 0, 0, 0], (N, 1)),
            np.zeros((N, 6)), np.zeros((N, 6)))


@dataclass(frozen=True)
class Noise:
    """Standard deviation of single samples: q (n,) [rad], p (3,) [m], rotation about any axis [rad]."""

    q: Array
    p: Array
    rotation: float


def smooth(time: Array, joints: tuple[str, ...], q: Array, p_WB: Array, quat_WB: Array, window: float,
           ) -> tuple[RobotTrajectory, Noise]:
    """A trajectory from samples of q (N, n) [rad], p_WB (N, 3) [m] and quat_WB (N, 4) wxyz at times (N,) [s], each smoothed and
    differentiated over `window` [s] by `differentiate`, and the noise that their scatter shows."""
    quat, _ = quaternions.continuous(quat_WB)
    parts = differentiate(time, np.column_stack([q, p_WB, quat]), window)
    n = q.shape[1]
    joint, place, turn = (_columns(parts, which) for which in (slice(n), slice(n, n + 3), slice(n + 3, n + 7)))
    u, omega, alpha = angular_motion(turn.value, turn.first, turn.second)
    trajectory = RobotTrajectory(
        time, joints, joint.value, joint.first, joint.second, place.value, u, np.column_stack([omega, place.first]),
        np.column_stack([alpha, place.second]))
    rotation = float(2 * np.sqrt(np.sum(turn.noise**2) / 3))  # a turn by d moves a quaternion by d/2; three directions of four
    return trajectory, Noise(joint.noise, place.noise, rotation)


def angular_motion(quat: Array, first: Array, second: Array) -> tuple[Array, Array, Array]:
    """Unit quaternion, angular velocity [rad/s] and acceleration [rad/s²] in W from a quaternion wxyz (N, 4) of any length and
    its time derivatives: with u = q/|q|, omega = 2 vec(u' u*), alpha = 2 vec(u'' u*)."""
    square = np.sum(quat**2, axis=1, keepdims=True)
    inverse = quaternions.conjugate(quat) / square
    rate, curve = quaternions.multiply(first, inverse), quaternions.multiply(second, inverse)
    omega = 2 * rate[:, 1:]
    alpha = 2 * curve[:, 1:] - 2 * rate[:, :1] * omega  # the second term is the change of |q|, which is not motion
    return quat / np.sqrt(square), omega, alpha


def _columns(d: Derivatives, which: slice) -> Derivatives:
    return Derivatives(d.value[:, which], d.first[:, which], d.second[:, which], d.noise[which])
