"""How far a simulated robot went, in one line."""

from __future__ import annotations

import numpy as np

from workbench.compare.metrics import heading, heading_change
from workbench.compare.options import COMPARE
from workbench.recording import quaternions as quat
from workbench.recording.take import Take


def how_it_went(take: Take) -> str:
    """Distance of the base link's origin, forward and to the left [m], speed over the time since the first command, change of
    heading [deg], and whether the robot fell; for a base held fixed the largest angle. take: simulated, absolute, time 0 = first
    command."""
    if take.p_WB is None or take.quat_WB is None or take.base == "fixed":
        joint = int(np.argmax(np.nanmax(np.abs(take.q), axis=0)))
        return f"on a stand; largest angle {np.rad2deg(np.nanmax(np.abs(take.q[:, joint]))):.1f} deg, at {take.joints[joint]}"
    moving = np.flatnonzero(take.since_start >= 0)
    first, last = (int(moving[0]), int(moving[-1])) if len(moving) else (0, len(take) - 1)
    way = take.p_WB[last] - take.p_WB[first]
    yaw = float(heading(take.quat_WB)[first])
    forward, left = np.cos(yaw) * way[0] + np.sin(yaw) * way[1], np.cos(yaw) * way[1] - np.sin(yaw) * way[0]
    seconds = float(take.time[last] - take.time[first])
    speed = f" ({abs(forward) / seconds:.3f} m/s)" if seconds > 0 else ""
    up = quat.matrix(take.quat_WB)[:, 2, 2]
    fell = np.flatnonzero((up < np.cos(COMPARE.fell_tilt)) | (take.p_WB[:, 2] < COMPARE.fell_height * take.p_WB[first, 2]))
    ending = f"; fell at {take.since_start[fell[0]]:.2f} s" if len(fell) else "; did not fall"
    turn = float(np.rad2deg(heading_change(take.quat_WB, take.since_start)))
    return f"went {forward:+.3f} m forward{speed} and {left:+.3f} m to the left, turned {turn:+.1f} deg{ending}"
