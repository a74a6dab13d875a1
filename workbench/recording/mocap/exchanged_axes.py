"""Checks by the robot's joints whether the components of a capture's quaternions are those that its header names: a hinge turns
about one axis, and exchanged components turn it about others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from workbench.recording.mocap.tracks import (
    SeenJoint,
    Tracks,
    capture_axes,
    model_axes,
    relative_rotation,
    seen_joints,
    turn_vectors,
)
from workbench.recording.quaternions import rotation_vector
from workbench.robot import RobotModel
from workbench.types import Array

NAMES = "XYZW"


@dataclass(frozen=True)
class AxisChecks:
    """joints: least number of joints that tell. moved: least RMS turn of a joint that counts [rad]. poor: share of the joints'
    turning that is about their axes, below which the file's names are doubted; sound captures have 0.998, with any two components
    exchanged at most 0.973. good: least share of another order that is named instead. better: how much of the turning beside the
    axes that order may leave at most, as a share. upright: least scalar of every body's first quaternion in that order, as robots
    begin near neutral. rows: of a track that are looked at, at most. yaws: headings that are tried."""

    joints: int = 4
    moved: float = 0.03
    poor: float = 0.99
    good: float = 0.97
    better: float = 0.2
    upright: float = 0.7
    rows: int = 200
    yaws: int = 72


CHECKS = AxisChecks()


def exchanged_components(tracks: Tracks, model: RobotModel, c: AxisChecks = CHECKS) -> str | None:
    """A line if the joints turn about their axes only where the components of all quaternions are taken in another order than the
    file names them; None if they do as named, if no order fits, or if too few joints are seen to move."""
    joints = [joint for joint in seen_joints(tracks.assets, model, "free")[0] if joint.parent is not None]
    if len(joints) < c.joints:
        return None
    thinned = _thin(tracks, max(1, len(tracks.time) // c.rows))
    own = _share_about_axes(thinned, joints, c)
    if not own < c.poor:
        return None
    shares = {order: _share_about_axes(meant, joints, c) for order, meant in _in_other_orders(thinned, c)}
    best = max(shares, key=lambda order: shares[order], default=NAMES)
    if not shares.get(best, 0.0) >= c.good or 1 - shares[best] > c.better * (1 - own):
        return None
    return (f"only {100 * own:.1f} % of the joints' turning is about their axes as the file names the quaternions' components, "
            f"but {100 * shares[best]:.1f} % if its X,Y,Z,W hold {','.join(best)}: are the columns exchanged?")


def _thin(tracks: Tracks, every: int) -> Tracks:
    return replace(tracks, time=tracks.time[::every], p=tracks.p[:, ::every], q=tracks.q[:, ::every],
                   seconds_squared=tracks.seconds_squared[:, ::every], mended=tracks.mended[::every])


def _in_other_orders(tracks: Tracks, c: AxisChecks) -> Iterator[tuple[str, Tracks]]:
    """Orders of the components that the file may have under the names X, Y, Z, W, and the tracks taken like that."""
    in_file = np.concatenate([capture_axes(tracks.q[..., 1:]), tracks.q[..., :1]], axis=-1)
    for order in permutations(NAMES):
        meant = in_file[..., [order.index(name) for name in NAMES]]
        first = [w[np.isfinite(w)][:1] for w in meant[..., 3]]
        if "".join(order) != NAMES and all(abs(w[0]) > c.upright for w in first if len(w)):
            yield "".join(order), replace(tracks, q=np.concatenate([meant[..., 3:], model_axes(meant[..., :3])], axis=-1))


def _share_about_axes(tracks: Tracks, joints: Sequence[SeenJoint], c: AxisChecks) -> float:
    """Share of the joints' turning [rad^2] that is about their own axes, at the heading at which it is largest; NaN if too few
    move."""
    moments: list[Array] = []
    axes: list[Array] = []
    for joint in joints:
        q = relative_rotation(tracks, joint)
        turned = rotation_vector(q[np.isfinite(q).all(axis=1)])
        if len(turned) and np.sqrt((turned**2).sum(axis=1).mean()) > c.moved:
            moments.append(turned.T @ turned / len(turned))
            axes.append(joint.axis)
    if len(moments) < c.joints:
        return float("nan")
    M, headings = np.array(moments), np.linspace(0, 2 * np.pi, c.yaws, endpoint=False)
    about = [np.einsum("ji,jik,jk->", a, M, a) for a in (turn_vectors(np.array(axes), yaw) for yaw in headings)]
    return float(max(about) / np.einsum("jii->", M))
