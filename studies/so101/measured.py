"""All that is measured on the recordings themselves, before any simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from studies.so101.programmes import Clock, Programme, clock, jaw_range
from studies.so101.response import Response, response
from studies.so101.rest import Current, Fastest, NamePosterior, current, fastest, standing
from studies.so101.rows import Rows, rows_of
from studies.so101.zero import Zero, zeros
from workbench.recording.formats.sage import JOINTS
from workbench.robot import Kinematics


@dataclass(frozen=True)
class Measured:
    """training: rows of training programmes, on which all but the clock rests; the rest by joint."""

    clock: Clock
    jaw_range: float
    training: list[Rows]
    moving: dict[str, Response]
    resting: dict[str, NamePosterior | None]
    zeros: dict[str, Zero]
    currents: list[Current]
    speeds: list[Fastest]


def measure(programmes: Sequence[Programme], arm: Kinematics) -> Measured:
    """Everything, from training programmes."""
    scale = jaw_range(list(programmes))
    training = [rows_of(p, arm) for p in programmes if p.trained]
    laws = [current(j, training) for j in JOINTS]
    return Measured(
        clock(list(programmes)), scale, training, {j: response(j, training) for j in JOINTS},
        {j: standing(j, training) for j in JOINTS}, {z.joint: z for z in zeros(training, arm)}, [c for c in laws if c],
        [fastest(j, training, scale if j == "Jaw" else 1.0) for j in JOINTS])
