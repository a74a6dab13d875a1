"""A family of gaits: one shape whose feet turn the body by more or less in each cycle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from workbench.files import InputError
from workbench.gait.certificate import NAME, read_certificate
from workbench.gait.machine import GaitMachine
from workbench.gait.shape import GaitShape
from workbench.gait.table import GaitTable, gait_table, joined
from workbench.motion import Commands
from workbench.robot import RobotModel

RESOLUTION = 0.005
"""Turns are rounded to this [rad per stance], an eighth of the scatter of one cycle's heading: tables are made once for each."""


class GaitFamily:
    """Cycles of one gait that differ in `turn` alone [rad per stance, to the left].

    The shape's own turn (its trim) is added to the requested turn. InputError where a table of the family cannot be made, because
    a goal is beyond the registers.
    """

    def __init__(self, machine: GaitMachine, shape: GaitShape) -> None:
        self.machine, self.shape = machine, shape
        self._tables: dict[int, GaitTable] = {}

    def table(self, turn: float) -> GaitTable:
        """Start, cycle and stop of the gait that turns by `turn` [rad per stance]."""
        key = round(turn / RESOLUTION)
        if key not in self._tables:
            self._tables[key] = gait_table(self.machine, replace(self.shape, turn=self.shape.turn + key * RESOLUTION), "drive")
        return self._tables[key]

    def cycle(self, turn: float) -> Commands:
        """The commands of one cycle."""
        return self.table(turn).cycle.commands(1)

    @property
    def start(self) -> Commands:
        """From neutral into the gait, going straight."""
        return self.table(0.0).start.commands(1)

    @property
    def stop(self) -> Commands:
        """From the gait to neutral."""
        return self.table(0.0).stop.commands(1)

    @property
    def period(self) -> float:
        """Of one cycle [s], the same for all of the family."""
        return self.table(0.0).period

    def sequence(self, turns: Sequence[float]) -> Commands:
        """The start, and a cycle for each of `turns` [rad per stance], as one schedule."""
        return joined([self.table(0.0).start, *(self.table(u).cycle for u in turns)], "drive").commands(1)


def load_family(motion: str | Path, model: RobotModel) -> GaitFamily:
    """The family of a gait that `optimize` wrote: its shape is read from the certificate in the folder of `motion`. InputError
    where there is none, or it is of another robot."""
    at = Path(motion).parent / NAME
    certificate = read_certificate(at)
    if certificate.model_sha256 != model.sha256:
        raise InputError(at, f"it was made for another robot ({certificate.model_sha256[:12]}) than this ({model.sha256[:12]})")
    try:
        shape = GaitShape.from_plain(certificate.shape)
    except (KeyError, TypeError, ValueError):
        raise InputError(at, "shape: expected the shape of a gait that was searched for; this one cannot be steered") from None
    return GaitFamily(GaitMachine(model), shape)
