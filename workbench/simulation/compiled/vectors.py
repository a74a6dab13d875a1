"""Small vectors, quaternions (wxyz) and rotations as plain numbers, for kernels."""

from __future__ import annotations

import math

import numpy as np

from workbench.simulation.compiled.arrays import Array
from workbench.simulation.compiled.kernel import part

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]


@part
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Three:
    """a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@part
def turned(R: Array, x: float, y: float, z: float) -> Three:
    """R (3, 3) times a vector."""
    return (R[0, 0] * x + R[0, 1] * y + R[0, 2] * z, R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
            R[2, 0] * x + R[2, 1] * y + R[2, 2] * z)


@part
def quat_product(a: Four, b: Four) -> Four:
    """Of two quaternions."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (aw * bw - ax * bx - ay * by - az * bz, aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx, aw * bz + ax * by - ay * bx + az * bw)


@part
def quat_unit(a: Four) -> Four:
    """Of length one."""
    w, x, y, z = a
    size = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return w * size, x * size, y * size, z * size


@part
def quat_inverse(a: Four) -> Four:
    """Of a unit quaternion."""
    w, x, y, z = a
    return w, -x, -y, -z


@part
def quat_heading(a: Four) -> float:
    """Of the x axis that a unit quaternion turns [rad]."""
    w, x, y, z = a
    return math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))


@part
def quat_about_z(angle: float) -> Four:
    """A turn about z [rad]."""
    return math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle)


@part
def rotation_vector(a: Four) -> Three:
    """Of a unit quaternion [rad], no longer than half a turn."""
    w, x, y, z = a
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    size = math.sqrt(x * x + y * y + z * z)
    if size < 1e-12:
        return 2.0 * x, 2.0 * y, 2.0 * z
    factor = 2.0 * math.atan2(size, w) / size
    return factor * x, factor * y, factor * z


@part
def quat_of_vector(x: float, y: float, z: float) -> Four:
    """Of a rotation vector [rad]."""
    angle = math.sqrt(x * x + y * y + z * z)
    factor = 0.5 if angle < 1e-12 else math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), factor * x, factor * y, factor * z


@part
def write_rotation(a: Four, R: Array) -> None:
    """The matrix (3, 3) of a quaternion of any length."""
    w, x, y, z = a
    s = 2.0 / (w * w + x * x + y * y + z * z)
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)


@part
def clamp(x: float, low: float, high: float) -> float:
    """x within low and high."""
    return min(max(x, low), high)


@part
def quat_of(base: Array) -> Four:
    """The first four numbers of a pose."""
    return base[0], base[1], base[2], base[3]


INFINITY = np.inf
