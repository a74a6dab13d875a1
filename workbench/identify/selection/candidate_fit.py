"""A candidate that was fitted or screened out, and what rivals that are evaluated side by side know of each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from workbench.identify.parameters import Candidate
from workbench.types import Array


@dataclass(frozen=True)
class CandidateFit:
    """A candidate fitted beside the effects there were. gain: of chi squared by use; by_channel: that of "choose", as
    `RolloutEvaluator.by_channel` has them, empty of one that was not fitted; closed: share of what was beyond noise on the
    choosing stretches; joint: whose channels alone were looked at, None for all. screened_out: whether responses alone said so
    much less of it than of a rival that no fit was made; promised: what its response then takes off chi squared, and what the
    best rival's does."""

    candidate: Candidate
    x: Array
    gain: Mapping[str, float]
    joint: str | None
    screened_out: bool = False
    promised: tuple[float, float] = (0.0, 0.0)
    closed: float = 0.0
    by_channel: Array = field(default_factory=lambda: np.empty(0), repr=False)


@dataclass(frozen=True)
class Race:
    """What rivals that are fitted side by side know of each other: the best gain that an earlier screening's responses predict,
    that those seen now do, and that a first step reached, by joint; wide: what is predicted of each that all channels judge, of
    one number, as coarse steps show it, and of several; least: what must be predicted of one that is fitted; no_fixed_base:
    whether no take had a fixed base, so that floating-base takes alone tell what joints lack, however much."""

    remembered: dict[str | None, float] = field(default_factory=dict)
    predicted: dict[str | None, float] = field(default_factory=dict)
    reached: dict[str | None, float] = field(default_factory=dict)
    wide: dict[bool, list[float]] = field(default_factory=dict)
    least: float = 0.0
    no_fixed_base: bool = False


def note_best(best: dict[str | None, float], joints: Sequence[str | None], gains: Sequence[float]) -> None:
    """Keeps the largest gain for each joint."""
    for j, gain in zip(joints, gains):
        best[j] = max(best.get(j, 0.0), gain)


def best_at(best: dict[str | None, float], joint: str | None) -> float:
    """At a joint; of all, for what concerns all."""
    return max(best.values()) if joint is None else best[joint]
