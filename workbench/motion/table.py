"""Pose tables in the servos' own units, and the thesis's conversion of angles into them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.motion.commands import Commands
from workbench.motion.lead_in import paced
from workbench.robot import InputError
from workbench.robot.servo_units import AX12A, ServoUnits

Array = NDArray[np.float64]
Counts = NDArray[np.int64]

MOST_CYCLES = 10_000
"""Of one run: hours of walking."""


@dataclass(frozen=True, eq=False)
class PoseTable:
    """Poses as the firmware plays them: each is sent, then waited for.

    joints: (n,) names. goals: (P, n) goal positions. speeds: (P, n) moving speeds, 0 = at once. dwells_ms: (P,) [ms], at least 1.
    source: where they come from. units: (n,) what each joint's counts mean and where they end (default: the AX-12A's, 0 to 1023).
    InputError names joint, pose and value out of range.
    """

    joints: tuple[str, ...]
    goals: Counts
    speeds: Counts
    dwells_ms: Counts
    source: str = "pose table"
    units: tuple[ServoUnits, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "units", self.units or (AX12A,) * len(self.joints))
        shape = (len(self.dwells_ms), len(self.joints))
        if self.goals.shape != shape or self.speeds.shape != shape:
            raise InputError(self.source, f"expected goals and speeds for {shape[0]} poses of {shape[1]} joints")
        if len(self.units) != len(self.joints):
            raise InputError(self.source, f"{len(self.units)} servos' units for {len(self.joints)} joints")
        if 0 in shape:
            raise InputError(self.source, "expected at least one pose of one joint")
        for what, counts, most in (("goal position", self.goals, self._of(lambda u: u.highest)),
                                   ("moving speed", self.speeds, self._of(lambda u: u.fastest))):
            for k, i in np.argwhere((counts < 0) | (counts > most))[:1]:
                place = f"pose {k + 1}, joint {self.joints[i]}"
                raise InputError(self.source, f"{place}: {what} {counts[k, i]} is outside 0 to {most[i]:g}")
        for k in np.flatnonzero(self.dwells_ms < 1)[:1]:
            raise InputError(self.source, f"pose {k + 1}: dwell of {self.dwells_ms[k]} ms; expected 1 or more")

    def __len__(self) -> int:
        return len(self.dwells_ms)

    @staticmethod
    def from_angles(joints: tuple[str, ...], times: Array, angles: Array, source: str = "motion",
                    moving_speeds: Array | None = None, units: tuple[ServoUnits, ...] = ()) -> PoseTable:
        """The thesis's equations 3.1 to 3.4: rows of angles (K, n) [rad] at times (K,) [s] become K - 1 poses.

        Goals and speeds are rounded to the counts of each joint's servo (units; the AX-12A's: 300/1023 deg about 512 and 114/1023
        rpm), dwells to milliseconds. The first row gives no pose of its own, only the speed of the first pose. moving_speeds:
        (K, n) [rad/s] in place of the travel over the dwell.
        """
        each = units or (AX12A,) * len(joints)
        elapsed = np.diff(times)
        with np.errstate(divide="raise", invalid="raise", over="ignore"):
            asked = np.abs(np.diff(angles, axis=0) / elapsed[:, None] if moving_speeds is None else moving_speeds[1:])
        return PoseTable(
            joints,
            goals=np.array([u.centre for u in each]) + _nearest(angles[1:] / np.array([u.count for u in each])),
            speeds=_nearest(asked / np.array([u.table_unit for u in each])),
            dwells_ms=_nearest(elapsed * 1000, lost=0.0),  # in the file's own unit: what lies below a half stays below
            source=source,
            units=each,
        )

    def angles(self) -> Array:
        """Goals as angles (P, n) [rad], zero = servo centre."""
        return np.asarray((self.goals - self._of(lambda u: u.centre)) * self.count, dtype=float)

    @property
    def families(self) -> tuple[ServoUnits, ...]:
        """The units, each once."""
        return tuple(dict.fromkeys(self.units))

    @property
    def count(self) -> Array:
        """One count of position (n,) [rad] of each joint's servo."""
        return self._of(lambda u: u.count)

    def rates(self) -> Array:
        """Moving speeds (P, n) [rad/s] as the servos take these counts; 0 = at once."""
        return np.asarray(self.speeds * self._of(lambda u: u.speed_unit), dtype=float)

    def moving_speeds(self) -> Array:
        """Moving speeds (P, n) [rad/s] that equation 3.3 turns into these counts."""
        return np.asarray(self.speeds * self._of(lambda u: u.table_unit), dtype=float)

    def commands(self, cycles: int = 1) -> Commands:
        """What the firmware sends: each pose when the dwells before it are over, all poses again for each cycle; no joint at once
        (`paced`)."""
        if not 1 <= cycles <= MOST_CYCLES:
            raise InputError(self.source, f"cycles: expected 1 to {MOST_CYCLES}, got {cycles}")
        ends = np.cumsum(np.tile(self.dwells_ms, cycles)) / 1000
        goals = np.tile(self.angles(), (cycles, 1))
        return paced(Commands(
            times=np.concatenate([[0.0], ends[:-1]]),
            joints=self.joints,
            goals=goals,
            speeds=np.tile(self.rates(), (cycles, 1)),
            enabled=np.ones(goals.shape, dtype=bool),
            end=float(ends[-1]),
            poses=np.tile(np.arange(len(self)), cycles),
        ), self.count, self._of(lambda u: u.speed_unit))

    def _of(self, what: Callable[[ServoUnits], float]) -> Array:
        return np.array([what(u) for u in self.units], dtype=float)


def _nearest(x: Array, lost: float = 1e-9) -> Counts:
    """Nearest integers, halves away from zero as MATLAB rounds, with halves that were lost, by at most so much, to the change of
    units."""
    size = np.minimum(np.abs(x), 1e15)  # what is larger is refused as it is, and fits the type
    return np.asarray(np.sign(x) * np.floor(size + 0.5 + lost), dtype=np.int64)
