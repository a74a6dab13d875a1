"""Where a walk is on the brink: what nobody could tell from the model sends it elsewhere, as one foot just holds or slips.

Steps and contact models are three samples of what engines make of a walk; where they happen to agree, the robot may still go
another way. So robots next to the model are played, and what a recording shows only after they part from it is no gap: every
name that moves the robot at all would take some of it away.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.gap.evidence import TakeEvidence
from workbench.gap.jury import Jury, Question
from workbench.gap.ledger import GAP_RATIO, channel_gaps
from workbench.robot import EffectSpec, RobotModel

Array = NDArray[np.float64]
FRICTION, SHIFT, MASS = 0.05, 1e-3, 0.01
"""By how much robots next to the model differ: share of the floor's friction, as walks of robots that lack
nothing, played by another engine, want that much more; centre of mass [m] and mass [kg] of the base: nobody weighs cables."""
PARTED = 0.5
"""RMS over sigma, from the first command on, in some channel, from which on they have parted, if to the end it becomes what would
be a gap."""


def next_to(model: RobotModel) -> list[RobotModel]:
    """Robots that differ from a model by next to nothing."""
    grip = model.ground.friction  # where the SDF has its own for each foot, the others are enough
    floors = [replace(model, ground=replace(model.ground, friction=grip * (1 + d))) for d in (-FRICTION, FRICTION) if grip]
    moved = [EffectSpec("com_shift", (model.base,), {"offset": o})
             for o in ((SHIFT, 0.0, 0.0), (-SHIFT, 0.0, 0.0), (0.0, SHIFT, 0.0), (0.0, -SHIFT, 0.0))]
    loaded = EffectSpec("payload", (model.base,), {"mass": MASS, "position": (0.0, 0.0, 0.0)})
    return floors + [replace(model, effects=(*model.effects, e)) for e in (*moved, loaded)]


def judged_until(jury: Jury, model: RobotModel, residuals: Mapping[int, Array], takes: tuple[int, ...]) -> dict[int, float]:
    """For takes with a gap, until when after the first command [s] robots next to the model stay with it, where all of the gap
    comes after; empty where some take shows one before, as then something is missing. residuals (N, c): what the model leaves, by
    take."""
    evidence = jury.evidence
    ill = tuple(i for i in takes if channel_gaps(evidence[i], residuals[i]))
    if not ill or not all(jury.walks((i,)) for i in ill):
        return {}
    near = jury.residuals([Question(m, ill) for m in next_to(model)])
    until = {i: _parted(evidence[i], [n[i] - residuals[i] for n in near]) for i in ill}
    early = (channel_gaps(evidence[i], before(evidence[i], residuals[i], t)) for i, t in until.items())
    return {} if any(early) else until


def before(e: TakeEvidence, residual: Array, until: float) -> Array:
    """A residual (N, c) with NaN from a time after the first command [s] on."""
    return np.where(e.since[:, None] <= until, residual, np.nan)


def _parted(e: TakeEvidence, apart: list[Array]) -> float:
    """Until when [s] robots that are so far apart (N, c) over sigma from the model stay with it; inf where they do to the end."""
    moving = np.square(np.nan_to_num(np.array(apart)[:, e.moving]))
    so_far = np.sqrt(np.cumsum(moving, axis=1) / np.arange(1, moving.shape[1] + 1)[None, :, None]).max(axis=(0, 2))
    if so_far[-1] <= GAP_RATIO:
        return np.inf
    with_it = e.since[e.moving][so_far <= PARTED]
    return float(with_it[-1]) if len(with_it) else 0.0
