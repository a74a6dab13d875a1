"""Quaternions wxyz in bulk, (..., 4); the few operations this package needs, without a Python loop.

Rows of NaN are gaps and stay so, where scipy's Rotation refuses them; operations on rows without gaps use scipy.
"""

from __future__ import annotations

import numpy as np

from workbench.types import Array


def multiply(a: Array, b: Array) -> Array:
    """Hamilton product a ⊗ b of (..., 4) and (..., 4), broadcast."""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack([aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
                     aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw], axis=-1)


def conjugate(q: Array) -> Array:
    """Inverse of unit quaternions (..., 4)."""
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def about(axis: Array, angle: float | Array) -> Array:
    """Rotation by `angle` (...) [rad] about a unit `axis` (3,): (..., 4)."""
    half = np.asarray(angle, dtype=float)[..., None] / 2
    return np.concatenate([np.cos(half), np.sin(half) * np.asarray(axis)], axis=-1)


def matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                     2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                     2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1).reshape(*q.shape[:-1], 3, 3)


def from_matrix(R: Array) -> Array:
    """Unit quaternions (N, 4), w not negative, of rotation matrices (N, 3, 3)."""
    xx, yy, zz = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    squares = np.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz])  # 4 w^2, 4 x^2, 4 y^2, 4 z^2
    a, b, c = R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]  # 4 wx, 4 wy, 4 wz
    d, e, f = R[:, 1, 0] + R[:, 0, 1], R[:, 2, 0] + R[:, 0, 2], R[:, 2, 1] + R[:, 1, 2]  # 4 xy, 4 xz, 4 yz
    products = np.stack([squares[0], a, b, c, a, squares[1], d, e, b, d, squares[2], f, c, e, f, squares[3]]).reshape(4, 4, -1)
    largest = np.argmax(squares, axis=0)  # by the row of the greatest component, so that none is divided by little
    q = products[largest, :, np.arange(len(R))]
    q = q / np.linalg.norm(q, axis=1, keepdims=True)
    return np.asarray(np.where(q[:, :1] < 0, -q, q))


def interpolate(time: Array, q: Array, at: Array) -> Array:
    """Rotations (M, 4) at times `at` (M,) within `time` (N,), increasing, by the shortest turn at an even rate between
    neighbours of q (N, 4) (slerp)."""
    from scipy.spatial.transform import Rotation, Slerp  # takes a quarter of a second to import, and logs need none of it

    return np.asarray(Slerp(time, Rotation.from_quat(q, scalar_first=True))(at).as_quat(scalar_first=True))


def rotation_vector(q: Array) -> Array:
    """Rotation vectors (..., 3) [rad], at most pi long, of unit quaternions (..., 4) of either sign."""
    q = np.where(q[..., :1] < 0, -q, q)
    s = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        scale = np.where(s > 1e-9, 2 * np.arctan2(s, q[..., :1]) / s, 2.0)
    return np.asarray(q[..., 1:] * scale)


def swing_twist(q: Array, axis: Array) -> tuple[Array, Array]:
    """q (N, 4) = swing ⊗ twist, twist about the unit `axis` (3,): twist angle (N,) in (-pi, pi] [rad], swing (N, 3) as
    a rotation vector, across the axis."""
    along = q[:, 1:] @ axis
    angle = 2 * np.arctan2(along, q[:, 0])
    angle = np.mod(angle + np.pi, 2 * np.pi) - np.pi
    swing = rotation_vector(multiply(q, conjugate(about(axis, angle))))
    return angle, swing


def angle_between(a: Array, b: Array) -> Array:
    """Angle of the rotation from a to b (...) [rad], whatever their signs."""
    c = np.abs(np.sum(a * b, axis=-1))
    return np.asarray(2 * np.arccos(np.clip(c, 0.0, 1.0)))


def mean(q: Array) -> Array:
    """Mean rotation (4,) of nearby unit quaternions (N, 4) of either sign; NaN rows are left out."""
    q = q[np.isfinite(q).all(axis=1)]
    if not len(q):
        return np.full(4, np.nan)
    q = np.where((q @ q[0])[:, None] < 0, -q, q)
    m = q.mean(axis=0)
    m = m / np.linalg.norm(m)
    return np.asarray(-m if m[0] < 0 else m)


def from_euler(angles: dict[str, Array], order: str) -> Array:
    """Intrinsic Euler angles {axis letter: (N,) [rad]}, turned in `order` (for example "XYZ"): (N, 4)."""
    q: Array | None = None
    for letter in order:
        turn = about(np.eye(3)["XYZ".index(letter)], angles[letter])
        q = turn if q is None else multiply(q, turn)
    assert q is not None
    return q


def continuous(q: Array) -> tuple[Array, int]:
    """q (N, 4) with each sign chosen to follow the last row seen (NaN rows stay), and how often the sign had changed."""
    q = q.copy()
    seen = np.flatnonzero(np.isfinite(q[:, 0]))
    if len(seen) < 2:
        return q, 0
    turn = np.where(np.sum(q[seen[1:]] * q[seen[:-1]], axis=1) < 0, -1.0, 1.0)
    q[seen[1:]] *= np.cumprod(turn)[:, None]
    return q, int((turn < 0).sum())
