"""A family of gaits: one shape whose feet turn the body, and move it to the side, by more or less in each cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.gait.certificate import NAME, certificate_beside, check_table
from workbench.gait.machine import GaitMachine
from workbench.gait.shape import GaitShape
from workbench.gait.table import GaitTable, gait_table, join_tables
from workbench.motion import Commands, PoseTable, load_motion
from workbench.robot import RobotModel

RESOLUTION = 0.005
"""Turns are rounded to this [rad per stance], an eighth of the scatter of one cycle's heading: tables are made once for each."""
SIDE_RESOLUTION = 0.0005
"""Sideways strides are rounded to this [m per stance]: 0.8 mm of a cycle's way, a quarter of the scatter of one step."""
PACE_RESOLUTION = 0.05
"""Paces are rounded to this share of the gait's stride."""


@dataclass(frozen=True)
class Steer:
    """What is asked of a cycle beyond the gait's own: turn [rad per stance] and sideways stride [m per stance], to the left."""

    turn: float = 0.0
    side: float = 0.0


STRAIGHT = Steer()


class GaitFamily:
    """Cycles of one gait that differ in what they are steered by (`Steer`) and in `pace`, the share of the gait's stride.

    The shape's own turn (its trim) and sideways stride are added to the requested ones. InputError where a table of the family
    cannot be made, because a goal is beyond the registers. Cycles begin at the pose (`phase` of the shape's cycle) that the
    joints reach most slowly, as the controller's program changes tables there only if the way is short; the poses before it
    belong to the start.
    """

    def __init__(self, machine: GaitMachine, shape: GaitShape) -> None:
        self.machine, self.shape = machine, shape
        self._tables: dict[tuple[int, int, int], GaitTable] = {}
        self.phase = _calmest(self._table(STRAIGHT).cycle)

    def cycle(self, steer: Steer = STRAIGHT, before: Steer = STRAIGHT, pace: float = 1.0, pace_before: float = 1.0) -> PoseTable:
        """One cycle after one steered by `before` at `pace_before`, whose last goals are elsewhere: the joints' speeds into its
        first pose are those of that way. The controller's program checks that the pose is within reach of them."""
        return self._enter(self._loop(steer, pace), self._loop(before, pace_before))

    def stop(self, before: Steer = STRAIGHT) -> PoseTable:
        """The poses from a cycle steered by `before` to neutral, going straight."""
        straight = self._table(STRAIGHT)
        rest = _part(straight.cycle, slice(self.phase, None))
        return self._enter(join_tables([rest, straight.stop], "drive"), self._loop(before, 1.0))

    @property
    def start(self) -> PoseTable:
        """The poses from neutral into the gait, going straight."""
        straight = self._table(STRAIGHT)
        if not self.phase:
            return straight.start
        return join_tables([straight.start, _part(straight.cycle, slice(0, self.phase))], "drive")

    @property
    def start_seconds(self) -> float:
        """How long the start takes [s]."""
        return float(self.start.dwells_ms.sum()) / 1000

    @property
    def period(self) -> float:
        """Duration of one cycle [s], the same for the whole family."""
        return self._table(STRAIGHT).period

    def sequence(self, steers: Sequence[Steer]) -> Commands:
        """The start, and a cycle for each of `steers`, as one schedule."""
        cycles = [self.cycle(u, before) for before, u in zip((STRAIGHT, *steers), steers)]
        return join_tables([self.start, *cycles], "drive").commands(1)

    def shape_of(self, steer: Steer, pace: float = 1.0) -> GaitShape:
        """The shape whose cycles are steered so and have this pace, rounded as the family's tables are."""
        turn, side, share = self._key(steer, pace)
        return replace(self.shape, turn=self.shape.turn + turn * RESOLUTION, side=self.shape.side + side * SIDE_RESOLUTION,
                       stride=self.shape.stride * share * PACE_RESOLUTION)

    def _key(self, steer: Steer, pace: float) -> tuple[int, int, int]:
        return round(steer.turn / RESOLUTION), round(steer.side / SIDE_RESOLUTION), round(pace / PACE_RESOLUTION)

    def _table(self, steer: Steer, pace: float = 1.0) -> GaitTable:
        key = self._key(steer, pace)
        if key not in self._tables:
            self._tables[key] = gait_table(self.machine, self.shape_of(steer, pace), "drive")
        return self._tables[key]

    def _loop(self, steer: Steer, pace: float) -> PoseTable:
        cycle = self._table(steer, pace).cycle
        return _part(cycle, np.roll(np.arange(len(cycle)), -self.phase))

    def _enter(self, table: PoseTable, before: PoseTable) -> PoseTable:
        way = np.abs(table.goals[0] - before.goals[-1]) * np.array([u.count for u in table.units])
        needed = np.ceil(self.shape.hurry * way / (table.dwells_ms[0] / 1000) / self.machine.speed_unit)
        speeds = table.speeds.copy()
        speeds[0] = np.clip(needed, 1, self.machine.fastest)
        return replace(table, speeds=speeds)


def _part(table: PoseTable, rows: slice | NDArray[np.int64]) -> PoseTable:
    return replace(table, goals=table.goals[rows], speeds=table.speeds[rows], dwells_ms=table.dwells_ms[rows])


def _calmest(cycle: PoseTable) -> int:
    """The pose of a cycle that all joints reach most slowly."""
    ways = np.abs(cycle.goals - np.roll(cycle.goals, 1, axis=0)).max(axis=1)
    return int(np.argmin(ways / cycle.dwells_ms))


def load_family(motion: str | Path, model: RobotModel) -> GaitFamily:
    """The family of a gait that `optimize` wrote: its shape is read from the certificate in the folder of `motion`. InputError
    where there is none, or it is of another robot or another table."""
    at, certificate = Path(motion).parent / NAME, certificate_beside(motion)
    if certificate.model_sha256 != model.sha256:
        raise InputError(at, f"it was made for another robot ({certificate.model_sha256[:12]}) than this ({model.sha256[:12]})")
    check_table(certificate, motion, load_motion(motion, model))
    try:
        shape = GaitShape.from_plain(certificate.shape)
    except (KeyError, TypeError, ValueError):
        raise InputError(at, "shape: expected the shape of a gait that was searched for; this one cannot be steered") from None
    return GaitFamily(GaitMachine(model), shape)
