"""Whether a captured robot stands still when its recording begins, as the zero of its angles requires."""

from __future__ import annotations

import numpy as np

from workbench.recording import quaternions as quat
from workbench.recording.mocap.tracks import relative_rotation, seen_joints, tracks_of
from workbench.recording.recording import Recording
from workbench.robot import RobotModel


def moving_at_start(recording: Recording, model: RobotModel, seconds: float, speed: float) -> tuple[tuple[str, ...], int]:
    """Joints that turn faster than `speed` [rad/s], the same way, through both of the first two stretches of `seconds` [s]; and
    how many joints are seen there."""
    tracks = tracks_of(recording)
    step = max(1, round(seconds * recording.rate))
    if len(tracks.time) <= 2 * step:
        return (), 0
    out, seen = [], 0
    for joint in seen_joints(tracks.assets, model, "fixed")[0]:
        q = relative_rotation(tracks, joint)[[0, step, 2 * step]]
        ways = quat.rotation_vector(quat.multiply(quat.conjugate(q[:-1]), q[1:]))
        seen += bool(np.isfinite(ways).all())
        least = speed * step / recording.rate
        if np.all(np.linalg.norm(ways, axis=1) > least) and ways[0] @ ways[1] > 0.5 * np.prod(np.linalg.norm(ways, axis=1)):
            out.append(joint.name)
    return tuple(out), seen
