"""Estimates where each rigid body's pivot lies on its link, and from that the base's origin."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.recording import quaternions as quat
from workbench.recording.mocap.angles import Angles, base_row
from workbench.recording.mocap.tracks import Tracks, turn_quaternion, turn_vectors
from workbench.robot import RobotModel
from workbench.types import Array, Mask

_PRIOR = 0.03  # [m] prior standard deviation of a pivot from its link's centre of mass
_FRAMES = 400
_MODEL = 1e-3  # [m] least standard deviation of link lengths and droop
_CORRELATED = 10  # errors of the model persist, so this many frames count as one


@dataclass(frozen=True)
class Pivots:
    """pivots and sigma: asset -> p_LP_L (3,) [m] in the link's frame and its standard deviation."""

    pivots: Mapping[str, Array]
    sigma: Mapping[str, Array]


def find_pivots(tracks: Tracks, angles: Angles, model: RobotModel, yaw: float, rest_pose: Mapping[str, float],
                rest_rotation: Array) -> Pivots:
    """Linear least squares for every pivot at once (3 unknowns each), through the kinematic tree.

    With B the base and P_A the pivot of asset A on link L: p_PbPa = R_WB (p_BL(q) + R_BL(q) p_LPa - p_BPb) in each frame, which
    is linear in all pivots. A direction in which no joint moves the pivot, above all across the machine, is determined weakly or
    not at all; there the prior decides (the link's centre of mass, 3 cm), and the sigma shows it. The recorded zeros correspond
    to `rest_pose` [rad] and the base's tilt `rest_rotation` (4,).
    """
    k = model.kinematics
    root = base_row(tracks, model)
    assets = tracks.assets
    centers = np.array([k.centers.get(model.rigid_bodies[a], np.zeros(3)) for a in assets])
    if root is None:
        return Pivots(dict(zip(assets, centers)), {a: np.full(3, _PRIOR) for a in assets})
    use = _frames(tracks, root)
    q = angles.q[use] + np.array([rest_pose.get(j, 0.0) for j in angles.joints])
    poses = k.forward(np.nan_to_num(q), angles.joints)
    p_B, R_B = poses[model.base]
    known = {j: np.isfinite(q[:, c]) for c, j in enumerate(angles.joints)}
    R_WB = quat.matrix(quat.multiply(turn_quaternion(tracks.q[root, use], -yaw), rest_rotation))
    size = 3 * len(assets)
    N, rhs = np.zeros((size, size)), np.zeros(size)
    b = slice(3 * root, 3 * root + 3)
    for i, asset in enumerate(assets):
        link = model.rigid_bodies[asset]
        chain = [j for j in k.chain(link) if j in k.joints]
        good = tracks.seen[i, use] & tracks.seen[root, use]
        for joint in chain:
            good &= known.get(joint, np.zeros(len(use), dtype=bool))
        if i == root or not good.any():
            continue
        p, R = poses[link]
        p_BL = np.einsum("nji,nj->ni", R_B, p - p_B)[good]
        R_BL = np.einsum("nji,njk->nik", R_B, R)[good]
        between = turn_vectors(tracks.p[i, use] - tracks.p[root, use], -yaw)[good]
        y = np.einsum("nji,nj->ni", R_WB[good], between) - p_BL
        a = slice(3 * i, 3 * i + 3)
        total = R_BL.sum(axis=0)
        N[a, a] += len(y) * np.eye(3)
        N[b, b] += len(y) * np.eye(3)
        N[a, b] -= total.T
        N[b, a] -= total
        rhs[a] += np.einsum("nji,nj->i", R_BL, y)
        rhs[b] -= y.sum(axis=0)
    weight = 1 / (_MODEL**2 * _CORRELATED)
    prior = np.eye(size) / _PRIOR**2
    information = weight * N + prior
    solution = np.linalg.solve(information, weight * rhs + prior @ centers.ravel()).reshape(-1, 3)
    covariance = np.linalg.inv(information)
    spread = np.sqrt(np.diag(covariance)).reshape(-1, 3)
    return Pivots(dict(zip(assets, solution)), dict(zip(assets, spread)))


def _frames(tracks: Tracks, root: int) -> NDArray[np.int64]:
    """Frames in which the base is seen and nothing is repaired, evenly spread, at most a few hundred."""
    use = np.flatnonzero(tracks.seen[root] & ~tracks.mended)
    if len(use) < 10:
        use = np.flatnonzero(tracks.seen[root])
    return use[np.linspace(0, len(use) - 1, min(len(use), _FRAMES)).astype(int)] if len(use) else use


def base_origin(tracks: Tracks, model: RobotModel, yaw: float, pivots: Mapping[str, Array], resting: Mask,
                rest_rotation: Array) -> Array:
    """The base's origin at rest (3,) [m] in the capture's axes turned into the model's: the base body's mean position less
    its pivot. Zero where the base was not tracked."""
    root = base_row(tracks, model)
    if root is None:
        return np.zeros(3)
    seen = tracks.seen[root]
    at = seen & resting if (seen & resting).any() else seen & (np.cumsum(seen) <= 1)
    offset = quat.matrix(rest_rotation) @ pivots[tracks.assets[root]]
    return np.asarray(tracks.p[root, at].mean(axis=0) - turn_vectors(offset, yaw))
