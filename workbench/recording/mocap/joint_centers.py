"""Estimates joint axes from the bodies on both sides, and from these the distances between the joints of a link. No link length,
pivot or zero of the model is used, so a wrong link length in the model shows without any simulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.recording import quaternions as quat
from workbench.recording.mocap.tracks import SeenJoint, Tracks
from workbench.types import Array

LEAST_TURN = 0.03
"""Least RMS angle [rad] of a joint whose axis can be estimated."""
LEAST_FRAMES = 50
PARALLEL = 0.9
"""Least cosine between two axes that count as parallel."""


@dataclass(frozen=True)
class Center:
    """A joint's axis: a point on it from the pivot of the parent's body and from that of the child's, and its direction, all (3,)
    [m] in that body's frame; covariance (6, 6) of both points, which does not constrain the axial direction."""

    in_parent: Array
    in_child: Array
    axis_in_parent: Array
    axis_in_child: Array
    covariance: Array


@dataclass(frozen=True)
class Span:
    """The vector from one joint to the next on the body between them: its component perpendicular to both axes, (3,) [m] in the
    body's frame, and the standard deviation of its length [m]."""

    joint: str
    following: str
    way: Array
    sigma: float


def joint_center(tracks: Tracks, joint: SeenJoint) -> Center | None:
    """Least squares of a point that is fixed in both bodies, p_P + R_P a = p_C + R_C b in each frame (R. M. Ehrig et al.,
    A survey of formal methods for determining the centre of rotation of ball joints, J. Biomechanics 39, 2006; for a single axis
    the position along it is undetermined, and the solution closest to the pivots is used). None where the parent was not
    tracked or the joint hardly turned."""
    if joint.parent is None:
        return None
    good = tracks.seen[joint.parent] & tracks.seen[joint.child] & ~tracks.mended
    n = int(good.sum())
    if n < LEAST_FRAMES:
        return None
    R_P, R_C = quat.matrix(tracks.q[joint.parent, good]), quat.matrix(tracks.q[joint.child, good])
    R_PC = np.einsum("nji,njk->nik", R_P, R_C)
    between = np.einsum("nji,nj->ni", R_P, tracks.p[joint.child, good] - tracks.p[joint.parent, good])
    total = R_PC.sum(axis=0)
    normal = np.block([[n * np.eye(3), -total], [-total.T, n * np.eye(3)]])
    right = np.concatenate([between.sum(axis=0), -np.einsum("nji,nj->i", R_PC, between)])
    powers, ways = np.linalg.eigh(normal)
    if powers[1] < n * LEAST_TURN**2 / 2:
        return None
    seen = ways[:, 1:]
    point = seen @ ((seen.T @ right) / powers[1:])
    left = between - point[:3] + R_PC @ point[3:]
    covariance = float(np.mean(left**2)) * (seen / powers[1:]) @ seen.T
    axes = [way / np.linalg.norm(way) for way in (ways[:3, 0], ways[3:, 0])]
    return Center(point[:3], point[3:], axes[0], axes[1], covariance)


def spans(tracks: Tracks, joints: Sequence[SeenJoint]) -> list[Span]:
    """The spans of each tracked link, from the axis that carries it to those that it carries."""
    centers = {j.name: (j, c) for j in joints if (c := joint_center(tracks, j)) is not None}
    out = []
    for carrying, first in centers.values():
        for following, second in centers.values():
            if following.parent == carrying.child:
                way = across(second.in_parent - first.in_child, first.axis_in_child, second.axis_in_parent)
                distance = float(np.linalg.norm(way))
                if distance > 0:
                    both = first.covariance[3:, 3:] + second.covariance[:3, :3]
                    out.append(Span(carrying.name, following.name, way, float(np.sqrt(way @ both @ way)) / distance))
    return out


def across(way: Array, one: Array, other: Array) -> Array:
    """The component of a vector (3,) between two axes, of directions (3,) each, that is perpendicular to both."""
    if abs(one @ other) > PARALLEL:
        axis = one + np.sign(one @ other) * other
        axis = axis / np.linalg.norm(axis)
        return np.asarray(way - axis * (axis @ way))
    normal = np.cross(one, other)
    normal = normal / np.linalg.norm(normal)
    return np.asarray(normal * (normal @ way))
