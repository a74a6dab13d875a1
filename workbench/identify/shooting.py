"""Multiple shooting of walks: every model starts from the recorded robot's state at each window, so that its errors show before
chaos does.

At the beginning of each window the simulated base is reset to the recorded one; frames until the feet have found the floor again
are excluded.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.identify.options import PROBLEM
from workbench.recording.take import Take
from workbench.simulation.steady import BaseStates
from workbench.types import Array, Mask


def edges(since: Array) -> Array:
    """Beginnings of the windows (K,) [s] of a take whose frames are at `since` (N,) [s] after the first command."""
    return np.arange(PROBLEM.window, float(since[-1]) - PROBLEM.window / 4, PROBLEM.window)


def base_states(recorded: Take) -> BaseStates | None:
    """The base of a walk at the beginning of each window; None where it is fixed or was not tracked. A window whose beginning no
    camera saw is left out, and the one before is extended."""
    if recorded.base != "free" or recorded.p_WB is None or recorded.quat_WB is None:
        return None
    seen: Mask = np.asarray(np.isfinite(np.hstack([recorded.p_WB, recorded.quat_WB])).all(axis=1))
    since = recorded.since_start
    half = PROBLEM.pose_frames // 2
    frames = [int(np.argmin(np.abs(since - t))) for t in edges(since)]
    frames = [i for i in frames if half <= i < len(since) - half and seen[i - half:i + half + 1].all()]
    if not frames:
        return None
    near = [slice(i - half, i + half + 1) for i in frames]
    states = [_state(since[n] - since[i], recorded.p_WB[n], recorded.quat_WB[n]) for i, n in zip(frames, near)]
    quat, v, w = (np.array(column) for column in zip(*states))
    return BaseStates(since[frames], quat, v, w)


def _state(t: Array, p_WB: Array, quat_WB: Array) -> tuple[Array, Array, Array]:
    """Turn quat (4,) and velocities v, w (3,) in the middle of some frames, t (n,) [s] from there, by parabolas through them."""
    powers = np.stack([np.ones_like(t), t, t * t], axis=1)
    _, v, _ = np.linalg.lstsq(powers, p_WB, rcond=None)[0]
    turns = Rotation.from_quat(quat_WB, scalar_first=True)
    middle = turns[len(t) // 2]
    turn, w, _ = np.linalg.lstsq(powers, (turns * middle.inv()).as_rotvec(), rcond=None)[0]
    return (Rotation.from_rotvec(turn) * middle).as_quat(scalar_first=True), v, w


def unsettled_frames(states: BaseStates, since: Array) -> Mask:
    """Frames (N,) that tell nothing, as feet have yet to find the floor."""
    frame = float(np.median(np.diff(since)))
    after = since[:, None] - states.times
    return np.asarray(((after > -frame) & (after < PROBLEM.settles)).any(axis=1))
