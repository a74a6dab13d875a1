"""From a gait's shape to the table that the firmware plays, and the ways into the gait and out of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.gait.machine import GaitMachine
from workbench.gait.shape import GaitShape
from workbench.motion import Commands, PoseTable
from workbench.types import Array, Mask

WAYS = (600, 150)
"""Dwells [ms] of the way between neutral and the gait's stance, and of the rest in it: 40 deg in 0.6 s are 1.2 rad/s, a fifth of
the servos' fastest, so that the robot is not thrown. Search and certificate play the same bytes."""
HALF = 0.5
"""Size of strides and lifts in the first and the last cycle."""


@dataclass(frozen=True, eq=False)
class GaitTable:
    """A gait as the firmware plays it. cycle: the poses that repeat. start: from neutral into the cycle. stop: from the cycle's
    end to neutral. reach: (P, F) [m] how far the feet of `cycle` stay from their path. asked: (P, n) [rad] the angles
    that the joints should have at the poses."""

    shape: GaitShape
    cycle: PoseTable
    start: PoseTable
    stop: PoseTable
    reach: Array
    asked: Array

    @property
    def whole(self) -> PoseTable:
        """The motion from power-on to standstill as one table of three sections, which is the one that is certified."""
        return PoseTable.in_sections(self.start, self.cycle, self.stop)

    def commands(self, cycles: int, whole: bool = False) -> Commands:
        """Start and `cycles` cycles, and with `whole` the stop."""
        return (self.whole if whole else PoseTable.in_sections(self.start, self.cycle, None)).commands(cycles)

    @property
    def start_seconds(self) -> float:
        """How long the start takes [s]."""
        return float(self.start.dwells_ms.sum()) / 1000

    @property
    def period(self) -> float:
        """Duration of one cycle [s], in whole milliseconds a pose."""
        return float(self.cycle.dwells_ms.sum()) / 1000


def gait_table(machine: GaitMachine, shape: GaitShape, source: str = "gait") -> GaitTable:
    """The table of a shape, rounded to counts and milliseconds. InputError where a goal is beyond the registers."""
    (paths,) = paths_of(machine, [shape])
    return table_of(machine, paths, source)


@dataclass(frozen=True, eq=False)
class Paths:
    """Where a shape puts the joints: q (P, n) [rad] in the cycle, small (P, n) in the first and the last one, stand (1, n)
    between them and neutral; off (P, F) [m]: how far feet stay from the path; stance (P, F)."""

    shape: GaitShape
    q: Array
    small: Array
    stand: Array
    off: Array
    stance: Mask


def paths_of(machine: GaitMachine, shapes: Sequence[GaitShape]) -> list[Paths]:
    """The paths of many shapes at once."""
    wanted = []
    for shape in shapes:
        sizes = np.repeat([1.0, HALF, 0.0], [shape.poses, shape.poses, 1])
        wanted.append((shape, np.concatenate([shape.phases, shape.phases, [0.0]]), sizes))
    return [_paths(shape, every, off, stances) for shape, (every, off, stances) in zip(shapes, machine.angles_of(wanted))]


def _paths(shape: GaitShape, every: Array, off: Array, stances: Mask) -> Paths:
    """The paths of one shape, from its angles at the poses of the cycle, of the small cycle, and in its stance. InputError for
    offsets of another number of poses or joints."""
    P, extra = shape.poses, np.array(shape.offsets)
    if not shape.offsets:
        extra = np.zeros_like(every[:P])
    if extra.shape != every[:P].shape:
        raise InputError(None, f"offsets: expected {P} rows of {every.shape[1]} angles, got {extra.shape}")
    return Paths(shape, every[:P] + extra, every[P:2 * P] + HALF * extra, every[2 * P:], off[:P], stances[:P])


def table_of(machine: GaitMachine, paths: Paths, source: str = "gait", led: bool = True) -> GaitTable:
    """`gait_table` of paths that are known. led: whether goals lead the angles as the inverse servo law requires;
    that takes most of the time, and no path that feet cannot reach is worth it."""
    shape, q, small, stand = paths.shape, paths.q, paths.small, paths.stand
    goals = _within(machine, q, q + shape.lead * machine.droop(shape, q, paths.stance)) if led and shape.lead else q
    dwells = _dwells(shape)
    cycle = pose_table(machine, goals, np.vstack([goals[-1:], goals[:-1]]), dwells, shape.hurry, source)
    neutral = np.zeros_like(stand)
    there, back = np.array(WAYS), np.array(WAYS[::-1])
    start = [pose_table(machine, np.vstack([stand, stand]), np.vstack([neutral, stand]), there, 1.0, source),
             pose_table(machine, small, np.vstack([stand, small[:-1]]), dwells, shape.hurry, source)]
    stop = [pose_table(machine, small, np.vstack([goals[-1:], small[:-1]]), dwells, shape.hurry, source),
            pose_table(machine, np.vstack([stand, neutral]), np.vstack([small[-1:], stand]), back, 1.0, source)]
    return GaitTable(shape, cycle, join_tables(start, source), join_tables(stop, source), paths.off, q)


def _within(machine: GaitMachine, q: Array, goals: Array) -> Array:
    """Goals no farther than joints turn, unless the path itself is: a lead beyond the angles ends there."""
    lower, upper = machine.bounds
    half = np.array([u.count for u in machine.units]) / 2
    return np.clip(goals, np.minimum(q, lower + half), np.maximum(q, upper - half))


def _dwells(shape: GaitShape) -> NDArray[np.int64]:
    """Whole milliseconds whose sums are nearest to the poses' arrivals, so that nothing adds up."""
    arrivals = np.round(1000 * shape.period * np.concatenate([[0.0], shape.phases])).astype(np.int64)
    return np.maximum(np.diff(arrivals), 1)


def pose_table(machine: GaitMachine, goals: Array, before: Array, dwells: NDArray[np.int64], hurry: float, source: str
               ) -> PoseTable:
    """Goals (P, n) [rad], each reached from `before` (P, n) at the end of its dwell [ms], or `hurry` times as fast, or as fast as
    the servo can."""
    units = machine.units
    counts = np.array([u.centre for u in units]) + np.round(goals / np.array([u.count for u in units])).astype(np.int64)
    speed = hurry * np.abs(goals - before) / (dwells[:, None] / 1000) / machine.speed_unit
    speeds = np.clip(np.ceil(speed), 1, machine.fastest).astype(np.int64)
    return PoseTable(machine.model.joints, counts, speeds, dwells, source, units)


def join_tables(parts: list[PoseTable], source: str) -> PoseTable:
    """One table without sections: the poses of one part after the other, all of the same joints."""
    first = parts[0]
    goals, speeds, dwells = (np.concatenate([getattr(p, f) for p in parts]) for f in ("goals", "speeds", "dwells_ms"))
    return PoseTable(first.joints, goals, speeds, dwells, source, first.units)
