"""Rigid bodies of a recording as stacked arrays in the model's axes, on an even clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench.files import InputError
from workbench.recording import quaternions as quat
from workbench.recording.recording import Recording
from workbench.robot import RobotModel
from workbench.types import Array, Mask

FARTHEST = 1000.0
"""Largest distance from the capture's origin [m]; no capture volume is larger."""
NOT_UNIT = 2e-3
"""Deviation from unit length that a quaternion written with four digits may have."""
_MAX_HOLE = 20  # a clock with more missing frames than this for each one seen is left with holes


@dataclass(frozen=True)
class Tracks:
    """time (N,) [s]. assets: A names. p: (A, N, 3) [m], q: (A, N, 4) unit quaternions wxyz, NaN where unseen, both in the model's
    axes turned by the yaw that is not known yet: x, -z, y of the capture's x, y, z. seconds_squared: (A, N), zero where
    seen, t(T - t) [s^2] of a filled sample t into a gap of T."""

    time: Array
    rate: float
    assets: tuple[str, ...]
    p: Array
    q: Array
    seconds_squared: Array
    mended: Mask
    problems: tuple[str, ...] = ()

    def index(self, asset: str) -> int:
        """Row of an asset."""
        return self.assets.index(asset)

    @cached_property
    def seen(self) -> Mask:
        """(A, N) where both position and rotation are known."""
        return np.asarray(np.isfinite(self.p).all(axis=-1) & np.isfinite(self.q).all(axis=-1))


def model_axes(v: Array) -> Array:
    """(..., 3) of the capture (x, y up, z) as (x, -z, y), z up. The same holds for a quaternion's vector part."""
    return np.stack([v[..., 0], -v[..., 2], v[..., 1]], axis=-1)


def capture_axes(v: Array) -> Array:
    """Inverse of `model_axes`."""
    return np.stack([v[..., 0], v[..., 2], -v[..., 1]], axis=-1)


def turn_vectors(v: Array, yaw: float) -> Array:
    """Turns vectors (..., 3) about the vertical by `yaw` [rad]."""
    c, s = np.cos(yaw), np.sin(yaw)
    return np.stack([c * v[..., 0] - s * v[..., 1], s * v[..., 0] + c * v[..., 1], v[..., 2]], axis=-1)


def turn_quaternion(q: Array, yaw: float) -> Array:
    """Expresses rotations (..., 4) in axes turned back: turns their vector part by `yaw` about the vertical."""
    return np.concatenate([q[..., :1], turn_vectors(q[..., 1:], yaw)], axis=-1)


def check_assets(recording: Recording, model: RobotModel) -> None:
    """InputError unless there are rigid bodies and each is a link of the model."""
    if not recording.rigid_bodies:
        what = f"only {len(recording.markers)} markers" if recording.markers else "nothing solved"
        raise InputError(recording.source, f"rigid bodies: expected the robot's links, found {what}")
    links = set(model.kinematics.links)
    for asset in recording.rigid_bodies:
        link = model.rigid_bodies.get(asset)
        if link is None:
            known = ", ".join(model.rigid_bodies) or "none"
            raise InputError(recording.source, f"asset '{asset}': no link is given for it in rigid_bodies (give it, or "
                                               f"export the take without the asset); known assets: {known}")
        if link not in links:
            raise InputError(model.description, f"rigid_bodies: asset '{asset}' is link '{link}', which the model lacks")


def tracks_of(recording: Recording) -> Tracks:
    """Stacks the bodies, normalises quaternions (a zero quaternion counts as unseen), fills holes in the frames with NaN."""
    assets = tuple(recording.rigid_bodies)
    frames = recording.frames - recording.frames[0]
    total = int(frames[-1]) + 1
    filled = total != len(frames) and total <= _MAX_HOLE * len(frames)
    count = total if filled else len(frames)
    at = frames if filled else np.arange(count)
    problems: list[str] = []
    p, q = np.full((len(assets), count, 3), np.nan), np.full((len(assets), count, 4), np.nan)
    for i, body in enumerate(recording.rigid_bodies.values()):
        p[i, at] = model_axes(body.p)
        far = np.abs(body.p).max(axis=1, initial=0.0) > FARTHEST
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            norm = np.linalg.norm(body.quat, axis=1, keepdims=True)
            unit = np.where((norm > 0.5) & (norm < 2) & ~far[:, None], body.quat / norm, np.nan)
        problems += _odd(assets[i], norm[:, 0], far)
        q[i, at] = np.concatenate([unit[:, :1], model_axes(unit[:, 1:])], axis=1)
    unseen = ~(np.isfinite(p).all(axis=-1) & np.isfinite(q).all(axis=-1))
    p[unseen], q[unseen] = np.nan, np.nan
    time = np.arange(count) / recording.rate if filled else recording.time
    return Tracks(time, recording.rate, assets, p, q, np.zeros((len(assets), count)), np.zeros(count, dtype=bool),
                  tuple(problems))


def _odd(asset: str, norm: Array, far: Mask) -> list[str]:
    """Problems of a body's numbers: quaternions that are not of unit length, positions outside any capture volume."""
    out = []
    lengths = norm[np.isfinite(norm) & (norm > 0)]
    off = lengths[np.abs(lengths - 1) > NOT_UNIT]
    if len(off) > 0.01 * len(lengths):
        out.append(f"{asset}: {len(off)} of {len(lengths)} quaternions are not of unit length ({off.min():.4g} to "
                   f"{off.max():.4g}); normalised, or treated as unseen beyond 0.5 to 2")
    if far.any():
        out.append(f"{asset}: {int(far.sum())} frame(s) more than {FARTHEST:g} m away: treated as unseen")
    return out


@dataclass(frozen=True)
class SeenJoint:
    """A joint between two tracked links: rows of the parent (None: a base held still and not tracked) and child in Tracks,
    and the axis (3,) in the base's axes in the neutral pose."""

    name: str
    parent: int | None
    child: int
    axis: Array


def seen_joints(assets: Sequence[str], model: RobotModel, base: str) -> tuple[list[SeenJoint], list[str]]:
    """Joints whose two sides are among the tracked `assets`, in the model's order, and a line for each that hides behind an
    untracked link. Rows of the joints are those of the assets."""
    k = model.kinematics
    row = {model.rigid_bodies[a]: i for i, a in reversed(list(enumerate(assets)))}
    neutral = {link: R[0] for link, (_, R) in k.forward(np.zeros((1, len(k.joints)))).items()}
    to_base = neutral[model.base].T if model.base in neutral else np.eye(3)
    joints, problems = [], []
    for link, i in row.items():
        between = []
        at: str = link
        while True:
            joint = k.parent_joint[at]
            if joint is None:
                break
            at = k.frames[joint].parent
            if joint in k.joints:
                between.append(joint)
            if at in row:
                break
        known = at in row or (base == "fixed" and at == model.base)
        if not between or not known:
            continue
        if len(between) > 1:
            problems.append(f"joints {' and '.join(between)}: they cannot be separated, as no link between them is tracked")
            continue
        f = k.frames[between[0]]
        axis = to_base @ neutral[f.parent] @ f.axis_of_parent
        joints.append(SeenJoint(f.name, row.get(at), i, axis))
    order = {name: n for n, name in enumerate(k.joints)}
    return sorted(joints, key=lambda j: order[j.name]), problems


def relative_rotation(tracks: Tracks, joint: SeenJoint) -> Array:
    """Rotation of child against parent since the neutral pose (N, 4), in the axes of the neutral pose."""
    child = tracks.q[joint.child]
    return child if joint.parent is None else quat.multiply(quat.conjugate(tracks.q[joint.parent]), child)
