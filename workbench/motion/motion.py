"""A motion: poses of joint angles at their arrival times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.motion.table import PoseTable
from workbench.robot.servo_units import ServoUnits

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses at their arrival times; the first row is where the cycle closes, and is not sent (docs/formats.md, section 2).

    times: (K,) [s], increasing, K at least 2. joints: (n,) names. angles: (K, n) [rad], zero = servo centre. speeds: (K, n)
    [rad/s] moving speeds, where they are not the travel over the dwell; the first row's count for nothing. units: (n,) counts of
    the joints' servos, to which all is rounded when it is played (default: the AX-12A's; `load_motion` takes the model's).
    """

    name: str
    times: Array
    joints: tuple[str, ...]
    angles: Array
    source: str = "motion"
    speeds: Array | None = None
    units: tuple[ServoUnits, ...] = ()

    def __post_init__(self) -> None:
        if self.angles.shape != (len(self.times), len(self.joints)):
            raise InputError(self.source, f"expected angles for {len(self.times)} times and {len(self.joints)} joints")
        if self.speeds is not None and self.speeds.shape != self.angles.shape:
            raise InputError(self.source, "expected as many moving speeds as angles")
        if len(self.times) < 2 or not self.joints:
            raise InputError(self.source, "expected one joint or more and two rows: where the cycle closes, and a pose")
        twice = [j for i, j in enumerate(self.joints) if j in self.joints[:i]]
        if twice:
            raise InputError(self.source, f"joint '{twice[0]}' stands there twice")
        for k, i in np.argwhere(~np.isfinite(self.angles))[:1]:
            raise InputError(
                self.source, f"row {k + 1}, joint {self.joints[i]}: expected a finite angle, got {self.angles[k, i]}")
        if self.speeds is not None:
            for k, i in np.argwhere(~(np.isfinite(self.speeds) & (self.speeds >= 0)))[:1]:
                place = f"row {k + 1}, joint {self.joints[i]}"
                raise InputError(self.source, f"{place}: expected a moving speed of 0 or more, got {self.speeds[k, i]}")
        for k in np.flatnonzero(~np.isfinite(self.times))[:1]:
            raise InputError(self.source, f"row {k + 1}: expected a finite time, got {self.times[k]}")
        for k in np.flatnonzero(np.diff(self.times) <= 0)[:1]:
            before, after = self.times[k:k + 2]
            raise InputError(self.source, f"row {k + 2}: time {after:.10g} s does not come after {before:.10g} s")

    @staticmethod
    def from_table(table: PoseTable) -> Motion:
        """The poses as angles at their arrival times, with their moving speeds, so that `as_table` gives the same counts; the
        first row is the last pose, where the cycle closes."""
        angles, speeds = table.angles(), table.moving_speeds()
        times = np.concatenate([[0.0], np.cumsum(table.dwells_ms) / 1000])
        return Motion(table.source, times, table.joints, np.vstack([angles[-1:], angles]), table.source,
                      np.vstack([speeds[-1:], speeds]), table.units)

    @property
    def duration(self) -> float:
        """Length of one cycle [s]."""
        return float(self.times[-1] - self.times[0])

    @property
    def closes(self) -> bool:
        """Whether the last row is the first one, so that cycles follow each other without a jump."""
        return bool(np.allclose(self.angles[0], self.angles[-1], rtol=0, atol=1e-9))

    def as_table(self) -> PoseTable:
        """In the firmware's units (thesis, equations 3.1 to 3.4); InputError for what the registers cannot hold."""
        return PoseTable.from_angles(self.joints, self.times, self.angles, self.source, self.speeds, self.units)

    def commands(self, cycles: int = 1) -> Commands:
        """What the firmware sends for so many cycles, rounded to the servo's counts and milliseconds."""
        return self.as_table().commands(cycles)
