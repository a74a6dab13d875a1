"""A motion: poses of joint angles at their arrival times."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from html import escape

import numpy as np

from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.motion.table import SECTIONS, PoseTable, Section
from workbench.robot.servo_units import ServoUnits
from workbench.types import Array


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses at their arrival times; the first row is where the cycle closes, and is not sent (docs/formats.md, section 2).

    times: (K,) [s], increasing, K at least 2. joints: (n,) names. angles: (K, n) [rad], zero = servo centre. speeds: (K, n)
    [rad/s] moving speeds, where they are not the travel over the dwell; the first row's count for nothing. units: (n,) counts of
    the joints' servos, to which all is rounded when it is played (default: the AX-12A's; `load_motion` takes the model's).
    start, stop: how many poses (the first row is none) at the beginning are played once, before the loop, and how many at the end
    once after it; the others are the loop, which is repeated. cycles: how often by the motion's own file; None where it does not
    say.
    """

    name: str
    times: Array
    joints: tuple[str, ...]
    angles: Array
    source: str = "motion"
    speeds: Array | None = None
    units: tuple[ServoUnits, ...] = ()
    start: int = 0
    stop: int = 0
    cycles: int | None = None

    def _repr_html_(self) -> str:
        """For a notebook: length and cycles in a sentence, and a row of the extreme angles of each joint."""
        rows = "".join(f"<tr><td>{escape(j)}</td><td>{a.min():.1f}</td><td>{a.max():.1f}</td></tr>"
                       for j, a in zip(self.joints, np.rad2deg(self.angles).T))
        return (f"<p>{escape(self.name)}: {len(self.times) - 1} poses in {self.times[-1] - self.times[0]:.2f} s"
                f"{'' if self.closes else '; the last pose is not the first'}</p>"
                f"<table><tr><th>joint</th><th>lowest [deg]</th><th>highest [deg]</th></tr>{rows}</table>")

    def __post_init__(self) -> None:
        if self.angles.shape != (len(self.times), len(self.joints)):
            raise InputError(self.source, f"expected angles for {len(self.times)} times and {len(self.joints)} joints")
        if self.speeds is not None and self.speeds.shape != self.angles.shape:
            raise InputError(self.source, "expected as many moving speeds as angles")
        if len(self.times) < 2 or not self.joints:
            raise InputError(self.source, "expected one joint or more and two rows: where the cycle closes, and a pose")
        if self.start < 0 or self.stop < 0 or self.start + self.stop > len(self.times) - 2:
            sections = f"{self.start} poses of start and {self.stop} of stop"
            raise InputError(self.source, f"{sections}: expected a pose of the loop, too")
        twice = [j for i, j in enumerate(self.joints) if j in self.joints[:i]]
        if twice:
            raise InputError(self.source, f"joint '{twice[0]}' is given twice")
        for k, i in np.argwhere(~np.isfinite(self.angles))[:1]:
            raise InputError(
                self.source, f"row {k + 1}, joint {self.joints[i]}: expected a finite angle, got {self.angles[k, i]}")
        if self.speeds is not None:
            for k, i in np.argwhere(~(np.isfinite(self.speeds) & (self.speeds >= 0)))[:1]:
                place = f"row {k + 1}, joint {self.joints[i]}"
                raise InputError(self.source, f"{place}: expected a moving speed of 0 or more deg/s, got "
                                              f"{math.degrees(self.speeds[k, i]):.6g}")
        for k in np.flatnonzero(~np.isfinite(self.times))[:1]:
            raise InputError(self.source, f"row {k + 1}: expected a finite time, got {self.times[k]}")
        for k in np.flatnonzero(np.diff(self.times) <= 0)[:1]:
            before, after = self.times[k:k + 2]
            raise InputError(self.source, f"row {k + 2}: time {after:.10g} s does not come after {before:.10g} s")

    @staticmethod
    def from_table(table: PoseTable) -> Motion:
        """The poses as angles at their arrival times, with their moving speeds, so that `as_table` gives the same counts; the
        first row is the last pose of the loop, where that closes, or neutral, where a start leads into it."""
        angles, speeds = table.angles(), table.moving_speeds()
        times = np.concatenate([[0.0], np.cumsum(table.dwells_ms) / 1000])
        last = len(table) - table.stop - 1
        first = np.zeros((1, len(table.joints))) if table.start else angles[last:last + 1]
        return Motion(table.source, times, table.joints, np.vstack([first, angles]), table.source,
                      np.vstack([speeds[last:last + 1], speeds]), table.units, table.start, table.stop)

    def as_sent(self) -> Motion:
        """The motion as a robot plays it that never gets a speed of 0 (`PoseTable.as_sent`), in whole counts."""
        return replace(Motion.from_table(self.as_table().as_sent()), cycles=self.cycles)

    @property
    def duration(self) -> float:
        """Length of one cycle of the loop [s]."""
        return float(self.times[len(self.times) - 1 - self.stop] - self.times[self.start])

    def seconds(self, cycles: int | None = None) -> float:
        """How long start, so many cycles (default: its own) and stop take [s]."""
        return float(self.times[-1] - self.times[0]) + (self.often(cycles) - 1) * self.duration

    def often(self, cycles: int | None, default: int = 1) -> int:
        """Number of cycles: as requested, else as in the motion, else the default."""
        return cycles if cycles is not None else self.cycles if self.cycles is not None else default

    @property
    def closes(self) -> bool:
        """Whether cycles follow each other without a jump: the loop ends in the first row, or a start leads into it."""
        last = self.angles[len(self.times) - 1 - self.stop]
        return self.start > 0 or bool(np.allclose(self.angles[0], last, rtol=0, atol=1e-9))

    @property
    def sections(self) -> tuple[Section, ...]:
        """The section of each row (K,); the first row, which is no pose, has that of the second."""
        loop = len(self.times) - 1 - self.start - self.stop
        of_poses = [name for name, n in zip(SECTIONS, (self.start, loop, self.stop)) for _ in range(n)]
        return (of_poses[0], *of_poses)

    def unrolled(self, cycles: int | None = None) -> Motion:
        """Start, so many cycles (default: its own) and stop as one motion without sections, to be played once."""
        table_rows = np.arange(1, len(self.times))
        last = len(self.times) - self.stop
        loop = np.tile(table_rows[self.start:last - 1], self.often(cycles))
        rows = np.concatenate([[0], table_rows[:self.start], loop, table_rows[last - 1:]])
        times = self.times[0] + np.concatenate([[0.0], np.cumsum(np.diff(self.times)[rows[1:] - 1])])
        return replace(self, times=times, angles=self.angles[rows], start=0, stop=0, cycles=1,
                       speeds=None if self.speeds is None else self.speeds[rows])

    def as_table(self) -> PoseTable:
        """The motion in the firmware's units (thesis, equations 3.1 to 3.4); InputError for values that the registers cannot
        hold."""
        return PoseTable.from_angles(
            self.joints, self.times, self.angles, self.source, self.speeds, self.units, self.start, self.stop)

    def commands(self, cycles: int | None = None) -> Commands:
        """The firmware's commands for the start, so many cycles (default: the motion's own, else 1) and the stop, rounded to the
        servo's counts and milliseconds."""
        return self.as_table().commands(self.often(cycles))
