"""What goes out on the bus: goal positions and moving speeds at given times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Commands:
    """A schedule of goals, each held until the next. Time zero is the first command.

    times: (K,) [s], increasing. joints: (n,) names. goals: (K, n) [rad], zero = servo centre. speeds: (K, n) [rad/s],
    0 = at once. enabled: (K, n) torque enable. end: when the last command's dwell is over [s].
    poses: (K,) index of the pose in its table, for the phase of the gait; -1 where there is none.
    """

    times: Array
    joints: tuple[str, ...]
    goals: Array
    speeds: Array
    enabled: NDArray[np.bool_]
    end: float
    poses: NDArray[np.int_]

    def __post_init__(self) -> None:
        shape = (len(self.times), len(self.joints))
        if self.goals.shape != shape or self.speeds.shape != shape or self.enabled.shape != shape:
            raise ValueError(f"expected goals, speeds and enabled of shape {shape}")
        if np.any(np.diff(self.times) <= 0):
            raise ValueError("command times must increase")

    def reference(self, t: Array) -> Array:
        """The servos' ramped reference at times t (N,): (N, n) [rad], from neutral before the first command (contract, section 4)."""
        t = np.asarray(t, dtype=float)
        out = np.zeros((len(t), len(self.joints)))
        ref = np.zeros(len(self.joints))
        edges = [*self.times, np.inf]
        for k, start in enumerate(self.times):
            inside = (t >= start) & (t < edges[k + 1])
            reach = np.where(self.speeds[k] > 0, self.speeds[k], np.inf)
            step = self.goals[k] - ref
            if inside.any():
                out[inside] = ref + _ramp(step, reach, t[inside, None] - start)
            if np.isfinite(edges[k + 1]):
                ref = ref + _ramp(step, reach, np.array([[edges[k + 1] - start]]))[0]
        return out

    def column(self, joint: str) -> int:
        """Index of a joint's column."""
        return self.joints.index(joint)

    def reordered(self, joints: tuple[str, ...]) -> Commands:
        """The same commands with columns in another order; joints without a command hold neutral, joints not asked for are dropped."""
        K = len(self.times)
        goals, speeds, enabled = np.zeros((K, len(joints))), np.zeros((K, len(joints))), np.ones((K, len(joints)), dtype=bool)
        for i, j in enumerate(joints):
            if j in self.joints:
                c = self.joints.index(j)
                goals[:, i], speeds[:, i], enabled[:, i] = self.goals[:, c], self.speeds[:, c], self.enabled[:, c]
        return Commands(self.times, joints, goals, speeds, enabled, self.end, self.poses)


def _ramp(step: Array, speed: Array, elapsed: Array) -> Array:
    with np.errstate(invalid="ignore"):
        reach = np.where(np.isinf(speed), np.inf, speed * elapsed)
    return np.asarray(np.clip(step, -reach, reach), dtype=float)
