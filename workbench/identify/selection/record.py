"""Record of a search: candidates that were fitted or screened out, round by round, with the accepted effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from workbench.identify.estimators.dropped_commands import DroppedCommands
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
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
class SelectionStep:
    """One step of the selection: rivals tried in addition to the accepted effects, the best first; accepted: those that were
    taken; stopped: by the limit of work, before every question was answered."""

    before: Fit
    trials: tuple[CandidateFit, ...]
    accepted: tuple[CandidateFit, ...]
    stopped: bool = False

    def rivals(self, trial: CandidateFit) -> list[CandidateFit]:
        """Trials at the same joint or link, the best first, `trial` among them; an effect of the whole robot rivals all."""
        place = trial.joint
        return [t for t in self.trials if place is None or t.joint in (place, None)]


@dataclass(frozen=True)
class SelectionResult:
    """The accepted effects, fitted together, and how they were found; search: its final state, with the settled effects and the
    takes as they were played; missed: poses that servos never received."""

    search: Search
    fit: Fit
    rounds: tuple[SelectionStep, ...]
    missed: tuple[DroppedCommands, ...] = ()

    @property
    def stopped(self) -> bool:
        """Whether the limit of work ended the search."""
        return any(r.stopped for r in self.rounds)


def accepted_effects(rounds: Sequence[SelectionStep]) -> list[CandidateFit]:
    """The accepted physical effects."""
    return [t for r in rounds for t in r.accepted if not _exact(t)]


def before_rough(rounds: Sequence[SelectionStep], current: Fit) -> Fit:
    """What there was before the first effect whose hundredths engines play differently."""
    return next((r.before for r in rounds if not all(map(_exact, r.accepted))), current)


def _exact(t: CandidateFit) -> bool:
    """Whether engines do not differ in it: in how cameras saw the robot, or when commands come; other speeds, which no number
    says, make another motion."""
    layer = t.candidate.effect.layer
    return layer == "measurement" or (layer == "timing" and t.candidate.size > 0)


def judged_by_all(search: Search, t: CandidateFit) -> bool:
    """Whether it was fitted by some number, and all channels judged it; not what fixed-base takes identified."""
    return not t.screened_out and t.joint is None and t.candidate.size > 0 and not search.is_settled(t.candidate)
