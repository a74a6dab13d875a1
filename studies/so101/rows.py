"""Rows for regressions: where a joint stood, moved and was sent to, and what gravity did there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from studies.so101.programmes import Programme
from workbench.recording.formats.sage import JOINTS
from workbench.robot import GRAVITY, Kinematics
from workbench.types import Array

LOADED = ("Pitch", "Elbow", "Wrist_Pitch")
"""Joints that gravity turns."""
EVERY = 5
"""Frames from one row to the next: neighbours tell nearly the same."""
SLOW = np.radians(2.0)
"""Least speed of a joint that is said to move [rad/s]."""
STEADY = 10.0
"""Most acceleration of a joint at which its smoothed path is believed [rad/s^2]."""
STILL = 0.3
"""Time without a count of motion after which a joint is said to stand [s]."""


@dataclass(frozen=True)
class Rows:
    """Rows of one programme, columns in JOINTS' order. frame (N,); q, v, a (N, 6) position, smoothed speed and acceleration;
    gravity (N, 6): torque of gravity on each joint [N m]; moving, standing (N, 6)."""

    of: Programme
    frame: NDArray[np.int_]
    q: Array
    v: Array
    a: Array
    gravity: Array
    moving: NDArray[np.bool_]
    standing: NDArray[np.bool_]

    def error(self, joint: int, delay: float = 0.0) -> Array:
        """Goal `delay` [s] earlier, between rows on the straight line, less position (N,) [rad]."""
        p = self.of
        return np.asarray(np.interp(p.time[self.frame] - delay, p.time, p.sent[:, joint]) - self.q[:, joint])

    @property
    def approach(self) -> Array:
        """Direction in which each joint's goal last moved (N, 6), 0 before it first did."""
        steps = np.sign(np.diff(self.of.sent, axis=0, prepend=self.of.sent[:1]))
        last = np.maximum.accumulate(np.where(steps != 0, np.arange(len(steps))[:, None], 0), axis=0)
        return np.asarray(np.take_along_axis(steps, last, axis=0)[self.frame])


def rows_of(p: Programme, arm: Kinematics) -> Rows:
    """Rows of a programme, away from its ends."""
    v = savgol_filter(p.read, 9, 2, deriv=1, delta=p.period, axis=0)
    a = savgol_filter(p.read, 13, 2, deriv=2, delta=p.period, axis=0)
    n = round(STILL / p.period)
    frame = np.arange(n, len(p.time) - 10, EVERY)
    back = np.stack([p.read[frame - k] for k in range(n)])
    q = p.read[frame]
    return Rows(p, frame, q, v[frame], a[frame], gravity(arm, q), (np.abs(v[frame]) > SLOW) & (np.abs(a[frame]) < STEADY),
                np.ptp(back, axis=0) < 1e-9)


def gravity(arm: Kinematics, q: Array, offsets: Array | None = None) -> Array:
    """Torque [N m] by which gravity turns each joint at angles q (N, 6) [rad], JOINTS' order; offsets (6,) are added to q."""
    q = q + (0.0 if offsets is None else offsets)
    poses = arm.forward(q, JOINTS)
    out = np.zeros((len(q), len(JOINTS)))
    for i, joint in enumerate(JOINTS):
        f = arm.frames[joint]
        p, R = poses[f.child]
        axis, origin = R @ f.axis_B, p + R @ f.p_BM
        for link in arm.links:
            if joint in arm.chain(link):
                centre = poses[link][0] + poses[link][1] @ arm.centers[link]
                moment = np.cross(centre - origin, [0.0, 0.0, -GRAVITY * arm.masses[link]])
                out[:, i] += np.einsum("ni,ni->n", axis, moment)
    return out
