"""What a simulated take tells about the way it walks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from workbench.recording.take import Take
from workbench.robot import RobotModel

Array = NDArray[np.float64]
FALLEN_TILT, FALLEN_HEIGHT, TURNED = np.radians(25), 0.6, np.radians(30)
"""A fall: tilt, or height by the height at rest. A turn: heading at the end of six seconds
(the step and the contact approximation alone move it by about 25 degrees); shorter runs get less in proportion."""


@dataclass(frozen=True)
class Gait:
    """How one run went. forward, left [m] and heading [rad] (left positive) at its end; seconds: how long.

    Over its whole cycles after the first: front_pull, mean of the ground's forward force on the front feet less that on the
    hind feet [N]; tail, tops (front, hind): peak to peak of the joint's angle by that of its goals, mean of the cycles.
    roll (right side down), pitch (nose up) [rad]: lowest, mean and highest of the last cycle, against the level, in the
    thesis's senses of x and z. slip: load-weighted speed of loaded feet over the ground [m/s]. A fallen run keeps what it did
    until its end.
    """

    fell: bool
    forward: float
    left: float
    heading: float
    seconds: float
    front_pull: float
    tail: float
    tops: tuple[float, float]
    roll: tuple[float, float, float]
    pitch: tuple[float, float, float]
    slip: float

    @property
    def walks(self) -> bool:
        """Goes forward without falling or turning."""
        return not self.fell and self.forward > 0 and abs(self.heading) < TURNED * self.seconds / 6


def read_gait(take: Take, model: RobotModel, cycle: float, tips: Mapping[str, Array]) -> Gait:
    """Reads a gait off a free take with contact forces. cycle: its length [s]; tips: of the feet [m], in their links."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    assert take.commands is not None
    w, x, y, z = take.quat_WB.T
    up = 1 - 2 * (x**2 + y**2)
    heading = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y**2 + z**2)))
    roll, pitch = np.arctan2(2 * (w * x + y * z), up), np.arcsin(np.clip(2 * (z * x - w * y), -1, 1))
    height = take.p_WB[:, 2] / take.p_WB[0, 2]
    start, end = int(np.argmax(take.time >= 0)), len(take) - 1
    moved = take.p_WB[end] - take.p_WB[start]
    cycles = [(take.time >= k * cycle) & (take.time < (k + 1) * cycle) for k in range(1, int(take.time[end] / cycle + 1e-9))]
    walking = np.any(cycles, axis=0)
    ahead = np.column_stack([np.cos(heading), np.sin(heading)])[walking]
    pull = {foot: float(np.nanmean(np.sum(take.contact[foot][walking, :2] * ahead, axis=1))) for foot in tips}
    goals = dict(zip(take.commands.joints, np.ptp(take.commands.goals, axis=0)))

    def share(*joints: str) -> float:
        return float(np.mean([[np.ptp(take.q[c, take.column(j)]) / goals[j] for c in cycles] for j in joints]))

    def spread(angle: Array) -> tuple[float, float, float]:
        last = angle[cycles[-1]]
        return float(last.min()), float(last.mean()), float(last.max())

    return Gait(
        fell=bool(np.min(up) < np.cos(FALLEN_TILT) or np.min(height) < FALLEN_HEIGHT),
        forward=float(moved[0]), left=float(moved[1]), heading=float(heading[end] - heading[start]),
        seconds=float(take.time[end]), front_pull=sum(v if foot[0] == "f" else -v for foot, v in pull.items()),
        tail=share("tail"), tops=(share("flt", "frt"), share("blt", "brt")), roll=spread(roll), pitch=spread(pitch),
        slip=_slip(take, model, tips))


def _slip(take: Take, model: RobotModel, tips: Mapping[str, Array]) -> float:
    """Speed of the feet's tips over the ground, weighted by their load [m/s]."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    poses = model.kinematics.forward(take.q, take.joints)
    base = Rotation.from_quat(take.quat_WB, scalar_first=True)
    total = load = 0.0
    for foot in tips:
        p, R = poses[model.foot_links[foot]]
        p_W = take.p_WB + base.apply(p + R @ tips[foot])
        speed = np.linalg.norm(np.gradient(p_W[:, :2], take.time, axis=0), axis=1)
        f = np.nan_to_num(take.contact[foot][:, 2])
        total, load = total + float(f @ speed), load + float(f.sum())
    return total / load if load else float("nan")
