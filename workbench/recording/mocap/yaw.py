"""Finds the robot's heading in the capture's axes from the axes about which its joints turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording import quaternions as quat
from workbench.recording.mocap.conventions import conventional
from workbench.recording.mocap.tracks import (
    SeenJoint,
    Tracks,
    check_assets,
    relative_rotation,
    seen_joints,
    tracks_of,
    turn_vectors,
)
from workbench.recording.mocap.unseen import without_unseen
from workbench.recording.recording import Recording
from workbench.robot import RobotModel
from workbench.types import Array

_LEAST = np.deg2rad(2.0)  # a joint that turns less determines its axis poorly
_CLEAR = 0.3


@dataclass(frozen=True)
class YawEstimate:
    """yaw [rad], positive to the left, of the model's forward axis in the capture's axes; sigma [rad]; by_joint:
    estimate from each joint alone [rad]."""

    yaw: float
    sigma: float
    by_joint: dict[str, float]


@dataclass(frozen=True)
class _Evidence:
    """Evidence of one joint in one take: horizontal direction (mod pi) of its rotation vectors, less the model's [rad], and its
    variance [rad^2]."""

    joint: str
    angle: float
    variance: float


def session_yaw(recordings: Sequence[Recording], model: RobotModel, commands: Sequence[Commands | None] = ()
                ) -> YawEstimate:
    """One yaw for all takes of a session, whose capture frame does not move (docs/formats.md, section 1).

    In the neutral pose every rigid body's frame is parallel to the capture's axes, whatever the robot's yaw; so the axes of the
    relative rotations give the yaw. Each joint's axis is the first principal axis of its rotation vectors; the weighted median
    over joints and takes is robust to a loose mount. That leaves half a turn undetermined: the positions of the bodies decide,
    else the sign with which joints follow their commands.
    """
    tracks = [_prepare(r, model) for r in recordings if r.sensing == "mocap"]
    return yaw_of(tracks, model, [*commands, *[None] * (len(tracks) - len(commands))])


def _prepare(recording: Recording, model: RobotModel) -> Tracks:
    check_assets(recording, model)
    return conventional(without_unseen(tracks_of(recording)), model)


def yaw_of(takes: Sequence[Tracks], model: RobotModel, commands: Sequence[Commands | None], base: str = "free") -> YawEstimate:
    """The same as `session_yaw`, from tracks."""
    evidence: list[_Evidence] = []
    for tracks in takes:
        for joint in seen_joints(tracks.assets, model, base)[0]:
            evidence += _axis_evidence(tracks, joint)
    if not evidence:
        raise InputError(None, "yaw: no tracked joint turns by more than 2 degrees about a level axis: the robot hardly "
                               "moves in them, or was not seen; give the session's `yaw` [deg]")
    angle = np.array([e.angle for e in evidence])
    weight = 1 / np.array([e.variance for e in evidence])
    doubled = np.sum(weight * np.exp(2j * angle))  # directions, not vectors: mod pi
    start = float(np.angle(doubled) / 2)
    off = _wrap(angle - start, np.pi)
    yaw = start + weighted_median(off, weight)
    off = _wrap(angle - yaw, np.pi)
    spread = 1.4826 * weighted_median(np.abs(off), weight)
    effective = float(weight.sum() ** 2 / (weight**2).sum())
    sigma = max(1.25 * spread / np.sqrt(effective), float(weight.sum() ** -0.5))
    if _faces_backwards(takes, model, commands, yaw, base):
        yaw += np.pi
    yaw = float(_wrap(np.array(yaw), 2 * np.pi))
    by_joint: dict[str, float] = {}
    for name in dict.fromkeys(e.joint for e in evidence):
        mine = [i for i, e in enumerate(evidence) if e.joint == name]
        by_joint[name] = yaw + float(np.average(off[mine], weights=weight[mine]))
    return YawEstimate(yaw, float(sigma), by_joint)


def _wrap(angle: Array, period: float) -> Array:
    return np.asarray(np.mod(angle + period / 2, period) - period / 2)


def weighted_median(values: Array, weights: Array) -> float:
    """Weighted median, interpolated between the two values around the middle of the weight."""
    order = np.argsort(values)
    v, w = values[order], weights[order]
    share = (np.cumsum(w) - w / 2) / w.sum()
    return float(np.interp(0.5, share, v))


def _axis_evidence(tracks: Tracks, joint: SeenJoint) -> list[_Evidence]:
    level = float(np.hypot(joint.axis[0], joint.axis[1]))
    r = quat.rotation_vector(relative_rotation(tracks, joint))
    r = r[np.isfinite(r).all(axis=1)]
    if level < 0.5 or len(r) < 10:
        return []
    values, vectors = np.linalg.eigh(r.T @ r / len(r))
    if values[2] < _LEAST**2:
        return []
    found = vectors[:, 2]
    angle = np.arctan2(found[1], found[0]) - np.arctan2(joint.axis[1], joint.axis[0])
    noise = max(values[1], 1e-8)  # perpendicular to the axis
    return [_Evidence(joint.name, float(angle), noise / (values[2] * len(r)) / level**2)]


def _faces_backwards(takes: Sequence[Tracks], model: RobotModel, commands: Sequence[Commands | None], yaw: float,
                     base: str) -> bool:
    layout = sum(_layout(t, model, yaw) for t in takes) / len(takes)
    if abs(layout) > _CLEAR:
        return layout < 0
    following = sum(_following(t, model, c, yaw, base) for t, c in zip(takes, commands) if c is not None)
    return (following or layout) < 0


def _layout(tracks: Tracks, model: RobotModel, yaw: float) -> float:
    """Correlation (-1 to 1) between the initial positions of the bodies and those of the model's links."""
    k = model.kinematics
    poses = k.forward(np.zeros((1, len(k.joints))))
    found, nominal = [], []
    for i, asset in enumerate(tracks.assets):
        at = np.flatnonzero(tracks.seen[i])
        if len(at) and asset in model.rigid_bodies:
            link = model.rigid_bodies[asset]
            p, R = poses[link]
            nominal.append((p[0] + R[0] @ k.centers.get(link, np.zeros(3)))[:2])
            found.append(turn_vectors(tracks.p[i, at[0]], -yaw)[:2])
    if len(found) < 3:
        return 0.0
    a, b = np.array(found) - np.mean(found, axis=0), np.array(nominal) - np.mean(nominal, axis=0)
    size = np.linalg.norm(a) * np.linalg.norm(b)
    return float(np.sum(a * b) / size) if np.linalg.norm(b) > 0.02 else 0.0


def _following(tracks: Tracks, model: RobotModel, commands: Commands | None, yaw: float, base: str) -> float:
    """Sum over joints [rad] of how far they turned towards the side to which commands move them further; needs no start."""
    assert commands is not None
    total = 0.0
    for joint in seen_joints(tracks.assets, model, base)[0]:
        if joint.name not in commands.joints:
            continue
        q = quat.swing_twist(relative_rotation(tracks, joint), turn_vectors(joint.axis, yaw))[0]
        goals = commands.goals[:, commands.column(joint.name)]
        high, low = float(np.nanmax(q)), float(np.nanmin(q))
        asked = float(goals.max() + goals.min())
        total += np.sign(asked) * (high + low) if abs(asked) > _LEAST else 0.0
    return total
