"""A candidate that was fitted or screened out, and what rivals that are evaluated side by side know of each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from workbench.identify.parameters import Candidate
from workbench.types import Array


@dataclass(frozen=True)
class CandidateFit:
    """A candidate fitted together with the effects accepted before. gain: of chi squared by use; by_channel: that of "choose", as
    in `RolloutEvaluator.by_channel`, empty if it was not fitted; closed: share of the excess error on the choosing stretches that
    it removes; joint: whose channels alone were considered, None for all. screened_out: whether its response alone predicted so
    much less than a rival's that it was not fitted; promised: the predicted reduction of chi squared by its response, and by the
    best rival's."""

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
    """Best gains so far, per joint, shared by candidates that are screened together: predicted by the responses of an earlier
    screening, predicted by the current ones, and achieved by a first step. wide: predicted gain of each candidate that is judged
    by every channel, with one parameter, at coarse steps, and with several; least: gain that must be predicted for a candidate to
    be fitted; no_fixed_base: whether no take had a fixed base, so that only floating-base takes constrain the joints."""

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
    """The best at a joint; over all joints for effects of the whole robot (None)."""
    return max(best.values()) if joint is None else best[joint]
