"""Channels: the observations of a take, as numbers that can be compared frame by frame.

Joint angles enter frame by frame, and for each joint its rotation about the axes across the servo's. Of the body, height and tilt
enter as they are, path and heading as their change over a quarter of a second: walking is chaotic over seconds, not over
fractions of one.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.compare.options import COMPARE
from workbench.compare.session_takes import RegisteredTake
from workbench.recording.take import Take
from workbench.types import Array

BODY = ("forward", "left", "heading", "height", "roll", "pitch")
ACROSS = "~"
"""Separates a joint's name from an axis (x, y or z of the base in neutral) perpendicular to its servo's: "flm~z"."""


def joint_of(channel: str) -> str:
    """The joint that a channel observes; for a channel of the body, the channel's own name."""
    return channel.partition(ACROSS)[0]


def channels_of(take: Take, names: tuple[str, ...]) -> Array:
    """Channels (N, c) of an observed take, by the joints and axes named."""
    body = body_channels(take) if BODY[0] in names else None
    out = np.zeros((len(take), len(names)))
    for i, name in enumerate(names):
        joint, _, axis = name.partition(ACROSS)
        if name in BODY:
            assert body is not None
            out[:, i] = body[:, BODY.index(name)]
        elif axis:
            if take.off_axis is not None:
                out[:, i] = take.off_axis[:, take.column(joint), "xyz".index(axis)]
        else:
            out[:, i] = take.q[:, take.column(joint)]
    return out


def body_channels(take: Take) -> Array:
    """Gains in path (in the heading's frame) and heading over `COMPARE.gain_span`, height, roll and pitch: (N, 6) [m, rad]."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    n = len(take)
    out = np.full((n, 6), np.nan)
    good = np.isfinite(take.quat_WB).all(axis=1) & np.isfinite(take.p_WB).all(axis=1)
    if not good.any():
        return out
    angles = np.full((n, 3), np.nan)
    angles[good] = Rotation.from_quat(take.quat_WB[good], scalar_first=True).as_euler("ZYX")
    angles[good, 0] = np.unwrap(angles[good, 0])
    step = max(1, round(COMPARE.gain_span / float(np.median(np.diff(take.time)))))
    gain = np.full((n, 3), np.nan)
    gain[:-step, :2] = take.p_WB[step:, :2] - take.p_WB[:-step, :2]
    gain[:-step, 2] = angles[step:, 0] - angles[:-step, 0]
    c, s = np.cos(angles[:, 0]), np.sin(angles[:, 0])
    out[:, 0] = c * gain[:, 0] + s * gain[:, 1]
    out[:, 1] = -s * gain[:, 0] + c * gain[:, 1]
    out[:, 2] = gain[:, 2]
    out[:, 3] = take.p_WB[:, 2] - np.nanmean(take.p_WB[take.resting, 2]) if take.resting.any() else take.p_WB[:, 2]
    out[:, 4], out[:, 5] = angles[:, 2], angles[:, 1]
    return out


def channel_names(t: RegisteredTake) -> tuple[str, ...]:
    """The channels of a take: its joints, their rotation across the axis, its body."""
    joints = t.recorded.joints
    across = []
    if t.recorded.off_axis is not None:
        k = t.model.kinematics
        neutral = k.forward(np.zeros((1, len(k.joints))))
        for i, j in enumerate(joints):
            axis = np.abs(neutral[k.frames[j].parent][1][0] @ k.frames[j].axis_of_parent)  # in the base's axes
            if np.isfinite(t.recorded.off_axis[:, i]).any():
                across += [f"{j}{ACROSS}{'xyz'[k]}" for k in np.sort(np.argsort(axis)[:2])]
    body = t.recorded.base == "free" and t.recorded.p_WB is not None  # a servo log of a walk shows joints alone
    return (*joints, *across, *(BODY if body else ()))
