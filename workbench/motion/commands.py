"""Commands on the bus: goal positions and moving speeds at given times."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.types import Array, Mask


@dataclass(frozen=True)
class Commands:
    """A schedule of goals, each held until the next. Time zero is the first command.

    times: (K,) [s], increasing. joints: (n,) names. goals: (K, n) [rad], zero = servo centre. speeds: (K, n) [rad/s],
    0 = at once. enabled: (K, n) torque enable. end: when the last command's dwell is over [s].
    poses: (K,) index of the pose in its table, for the phase of the gait; -1 where there is none. begun: whether the first goals
    had been sent long before, as in a log that begins in motion; else joints are in neutral until the first command. InputError
    where shapes differ or times do not increase.
    """

    times: Array
    joints: tuple[str, ...]
    goals: Array
    speeds: Array
    enabled: Mask
    end: float
    poses: NDArray[np.int_]
    begun: bool = False

    def __post_init__(self) -> None:
        shape = (len(self.times), len(self.joints))
        if self.goals.shape != shape or self.speeds.shape != shape or self.enabled.shape != shape:
            raise InputError(None, f"commands: expected goals, speeds and enabled of shape {shape}")
        if np.any(np.diff(self.times) <= 0):
            raise InputError(None, "commands: times must increase")

    def reference(self, t: Array) -> Array:
        """The servos' ramped reference (N, n) [rad] at times t (N,), at first neutral (docs/formats.md, section 4)."""
        t = np.asarray(t, dtype=float)
        reach = np.where(self.speeds > 0, self.speeds, np.inf)
        dwells = np.diff(self.times).tolist()
        from_ = np.zeros((len(self.times), len(self.joints)))  # the reference when each command comes
        for i in range(len(self.joints)):  # in floats, which take a tenth as long as so short arrays
            angle, held = 0.0, [0.0]
            for goal, speed, dwell in zip(self.goals[:, i].tolist(), reach[:, i].tolist(), dwells):
                most = speed * dwell
                angle += min(max(goal - angle, -most), most)
                held.append(angle)
            from_[:, i] = held[:len(from_)]
        last = np.searchsorted(self.times, t, side="right") - 1
        sent = last >= 0
        at = last[sent]
        out = np.zeros((len(t), len(self.joints)))
        out[sent] = from_[at] + _ramp(self.goals[at] - from_[at], reach[at], (t[sent] - self.times[at])[:, None])
        return out

    def slow_down(self, factor: float) -> Commands:
        """The same commands slowed down by a factor: times multiplied, speeds divided by it."""
        return replace(self, times=factor * self.times, speeds=self.speeds / factor, end=factor * self.end)

    def until(self, time: float) -> Commands:
        """Those that come until then [s]; the same object where that is all of them."""
        n = int(np.searchsorted(self.times, time, side="right"))
        if n == len(self.times):
            return self
        return replace(self, times=self.times[:n], goals=self.goals[:n], speeds=self.speeds[:n], enabled=self.enabled[:n],
                       poses=self.poses[:n], end=float(self.times[n]))

    def column(self, joint: str) -> int:
        """Index of a joint's column."""
        return self.joints.index(joint)

    def reordered(self, joints: tuple[str, ...]) -> Commands:
        """The same commands with columns in another order; joints without a command hold neutral, those left out are dropped."""
        if joints == self.joints:
            return self
        shape = (len(self.times), len(joints))
        goals, speeds, enabled = np.zeros(shape), np.zeros(shape), np.ones(shape, dtype=bool)
        for i, j in enumerate(joints):
            if j in self.joints:
                c = self.joints.index(j)
                goals[:, i], speeds[:, i], enabled[:, i] = self.goals[:, c], self.speeds[:, c], self.enabled[:, c]
        return Commands(self.times, joints, goals, speeds, enabled, self.end, self.poses, self.begun)


def _ramp(step: Array, speed: Array, elapsed: Array | float) -> Array:
    with np.errstate(invalid="ignore"):
        reach = np.where(np.isinf(speed), np.inf, speed * elapsed)
    return np.asarray(np.clip(step, -reach, reach), dtype=float)
