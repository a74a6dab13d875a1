"""Pose tables in the servos' own units, and the thesis's conversion of angles into them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.motion.lead_in import pace
from workbench.robot.servo_units import AX12A, ServoUnits
from workbench.types import Array

Counts = NDArray[np.int64]
Section = Literal["start", "loop", "stop"]
SECTIONS: tuple[Section, ...] = ("start", "loop", "stop")
"""In playing order: once, repeatedly, once."""

MOST_CYCLES = 10_000
"""Most cycles of one run: hours of walking."""


@dataclass(frozen=True, eq=False)
class PoseTable:
    """Poses as the firmware plays them: each is sent, then the dwell follows.

    joints: (n,) names. goals: (P, n) goal positions. speeds: (P, n) moving speeds, 0 = at once. dwells_ms: (P,) [ms], at least 1.
    source: their origin. units: (n,) each joint's counts and their range (default: the AX-12A's, 0 to 1023).
    start, stop: number of the first poses that are played once before the loop, and of the last ones played once after it; the
    poses between them are the loop, at least one. InputError names joint, pose and value out of range.
    """

    joints: tuple[str, ...]
    goals: Counts
    speeds: Counts
    dwells_ms: Counts
    source: str = "pose table"
    units: tuple[ServoUnits, ...] = ()
    start: int = 0
    stop: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "units", self.units or (AX12A,) * len(self.joints))
        shape = (len(self.dwells_ms), len(self.joints))
        if self.goals.shape != shape or self.speeds.shape != shape:
            raise InputError(self.source, f"expected goals and speeds for {shape[0]} poses of {shape[1]} joints")
        if len(self.units) != len(self.joints):
            raise InputError(self.source, f"{len(self.units)} servos' units for {len(self.joints)} joints")
        if 0 in shape:
            raise InputError(self.source, "expected at least one pose of one joint")
        if self.start < 0 or self.stop < 0 or self.loop < 1:
            sections = f"{self.start} poses of start and {self.stop} of stop"
            raise InputError(self.source, f"{sections}, of {len(self)} in all: expected at least one pose between them, the loop")
        for what, counts, most in (("goal position", self.goals, self._of(lambda u: u.highest)),
                                   ("moving speed", self.speeds, self._of(lambda u: u.fastest))):
            for k, i in np.argwhere((counts < 0) | (counts > most))[:1]:
                place = f"pose {k + 1}, joint {self.joints[i]}"
                raise InputError(self.source, f"{place}: {what} {counts[k, i]} is outside 0 to {most[i]:g}")
        for k in np.flatnonzero(self.dwells_ms < 1)[:1]:
            raise InputError(self.source, f"pose {k + 1}: dwell of {self.dwells_ms[k]} ms; expected 1 or more")

    def __len__(self) -> int:
        return len(self.dwells_ms)

    @property
    def loop(self) -> int:
        """Number of poses that are repeated."""
        return len(self) - self.start - self.stop

    @property
    def period(self) -> float:
        """Length of the loop [s]."""
        return float(self.dwells_ms[self.start:len(self) - self.stop].sum()) / 1000

    def order(self, cycles: int = 1) -> NDArray[np.int_]:
        """Indices of the poses as they are played: the start, so many loops, the stop."""
        every = np.arange(len(self))
        last = len(self) - self.stop
        return np.concatenate([every[:self.start], np.tile(every[self.start:last], cycles), every[last:]])

    def as_sent(self) -> PoseTable:
        """The table with the speeds that `play` and the controller's program send: where a pose has speed 0, at once, and the
        goal of the pose before, a joint may still be on its way there, and keeps its speed. The first pose of a section is left
        as it is, since more than one pose may come before it."""
        speeds = self.speeds.copy()
        for k in range(1, len(self)):
            if k not in (self.start, len(self) - self.stop):
                stays = (speeds[k] == 0) & (self.goals[k] == self.goals[k - 1])
                speeds[k, stays] = speeds[k - 1, stays]
        return replace(self, speeds=speeds)

    def part(self, section: Section) -> PoseTable | None:
        """The poses of one section as a table without sections; None where it has none."""
        last = len(self) - self.stop
        inside = {"start": slice(0, self.start), "loop": slice(self.start, last), "stop": slice(last, len(self))}[section]
        if inside.start == inside.stop:
            return None
        return PoseTable(self.joints, self.goals[inside], self.speeds[inside], self.dwells_ms[inside], self.source, self.units)

    @staticmethod
    def in_sections(start: PoseTable | None, loop: PoseTable, stop: PoseTable | None) -> PoseTable:
        """One table of three, of the same joints."""
        parts = [p for p in (start, loop, stop) if p is not None]
        goals, speeds, dwells = (np.concatenate([getattr(p, f) for p in parts]) for f in ("goals", "speeds", "dwells_ms"))
        return PoseTable(loop.joints, goals, speeds, dwells, loop.source, loop.units, len(start or ()), len(stop or ()))

    @staticmethod
    def from_angles(joints: tuple[str, ...], times: Array, angles: Array, source: str = "motion",
                    moving_speeds: Array | None = None, units: tuple[ServoUnits, ...] = (), start: int = 0, stop: int = 0,
                    ) -> PoseTable:
        """The thesis's equations 3.1 to 3.4: rows of angles (K, n) [rad] at times (K,) [s] become K - 1 poses.

        Goals and speeds are rounded to the counts of each joint's servo (units; the AX-12A's: 300/1023 deg about 512 and 114/1023
        rpm), dwells to milliseconds. The first row gives no pose of its own, only the speed of the first pose. moving_speeds:
        (K, n) [rad/s] in place of the travel over the dwell. start, stop: as in the class. The first pose of a loop after a start
        is reached from the start's last pose and from the loop's: without moving_speeds it gets the faster of the two speeds.
        """
        each = units or (AX12A,) * len(joints)
        elapsed = np.diff(times)
        with np.errstate(divide="raise", invalid="raise", over="ignore"):
            asked = np.abs(np.diff(angles, axis=0) / elapsed[:, None] if moving_speeds is None else moving_speeds[1:])
            if start and moving_speeds is None:
                again = np.abs(angles[start + 1] - angles[len(angles) - 1 - stop]) / elapsed[start]
                asked[start] = np.maximum(asked[start], again)
        return PoseTable(
            joints,
            goals=np.array([u.centre for u in each]) + _nearest(angles[1:] / np.array([u.count for u in each])),
            speeds=_nearest(asked / np.array([u.table_unit for u in each])),
            dwells_ms=_nearest(elapsed * 1000, lost=0.0),  # in the file's own unit: what lies below a half stays below
            source=source,
            units=each,
            start=start,
            stop=stop,
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
        """The firmware's commands: each pose when the dwells before it are over; the start, so many loops, the stop. No joint is
        sent speed 0 (`pace`)."""
        if not 1 <= cycles <= MOST_CYCLES:
            raise InputError(self.source, f"cycles: expected 1 to {MOST_CYCLES}, got {cycles}")
        played = self.order(cycles)
        ends = np.cumsum(self.dwells_ms[played]) / 1000
        goals = self.angles()[played]
        return pace(Commands(
            times=np.concatenate([[0.0], ends[:-1]]),
            joints=self.joints,
            goals=goals,
            speeds=self.rates()[played],
            enabled=np.ones(goals.shape, dtype=bool),
            end=float(ends[-1]),
            poses=played,
        ), self.count, self._of(lambda u: u.speed_unit))

    def _of(self, what: Callable[[ServoUnits], float]) -> Array:
        return np.array([what(u) for u in self.units], dtype=float)


def _nearest(x: Array, lost: float = 1e-9) -> Counts:
    """Nearest integers, halves away from zero as MATLAB rounds, with halves that were lost, by at most so much, to the change of
    units."""
    size = np.minimum(np.abs(x), 1e15)  # what is larger is refused as it is, and fits the type
    return np.asarray(np.sign(x) * np.floor(size + 0.5 + lost), dtype=np.int64)
