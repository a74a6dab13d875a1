"""Takes explained by forward selection: searched on a part of long sessions, compared with rivals, numbers refined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.identify.conclusions import ReadOff, Residuals, finding, list_rejected, list_unexplained, posterior, ties
from workbench.identify.estimators.dropped_commands import TakesAsPlayed, with_commands_of
from workbench.identify.fitting.doubts import downward_pulls, drifts
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.options import PROBLEM
from workbench.identify.problem import TakeEvidence
from workbench.identify.results.findings import Finding, Rejected, Unexplained
from workbench.identify.results.ties import Tie
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.identify.search_result import Problem, SearchResult
from workbench.identify.selection.acceptance import idle, too_little_left
from workbench.identify.selection.calibration import calibrate
from workbench.identify.selection.forward import select
from workbench.identify.selection.model_comparison import NamePosterior, compare_models
from workbench.identify.selection.record import SelectionStep
from workbench.identify.subset import data_subset, floors_everywhere, rebalance
from workbench.robot import Posterior, RobotModel
from workbench.types import Progress


@dataclass(frozen=True)
class Selected(SearchResult):
    """The final fit. played: takes as they were sent; rounds: of the selection; posteriors: probability of each effect; floors:
    numerical error by take, over sigma."""

    played: TakesAsPlayed
    rounds: tuple[SelectionStep, ...]
    search: Search
    fit: Fit
    posteriors: Sequence[NamePosterior]
    floors: Residuals

    @property
    def model(self) -> RobotModel:
        """The robot with its effects."""
        return self.fit.model(self.search.nominal)

    def takes_of(self, evaluator: RolloutEvaluator) -> RolloutEvaluator:
        """Whole takes with their commands as the search read them."""
        found = replace(self.played, missed=self.missed)
        return evaluator.on(with_commands_of(evaluator.evidence, found.as_found().evidence))

    def left_by(self, evaluator: RolloutEvaluator, progress: Progress) -> tuple[Residuals, Residuals]:
        """Residuals and numerical floors on whole takes, those too that the search did not look at."""
        everywhere = tuple(range(len(evaluator.evidence)))
        if not any(np.isfinite(e.until) for e in self.looked_at):
            if all(e.rough is seen.rough for e, seen in zip(evaluator.evidence, self.search.evaluator.evidence)):
                return self.fit.residuals, self.floors
            # what the search left to chance is left, nevertheless
            return evaluator.residuals([RolloutRequest(self.model, everywhere, PROBLEM.fine)])[0], self.floors
        progress("rolling out whole takes", None)
        after = evaluator.residuals([RolloutRequest(self.model, everywhere)])[0]
        return after, floors_everywhere(self.looked_at, self.floors)

    def findings(self, evidence: Sequence[TakeEvidence], before: Residuals, after: Residuals) -> tuple[Finding, ...]:
        """The effects, in the order in which they were found."""
        return tuple(finding(evidence, self.fit, i, self.posteriors[i], before, after) for i in range(len(self.fit.effects)))

    def unexplained(self, evidence: Sequence[TakeEvidence], after: Residuals, floors: Residuals) -> tuple[Unexplained, ...]:
        """Residuals beyond noise and numerical error, and doubts about the fitted effects."""
        drifting = (d.as_unexplained(evidence) for d in self.drifts)
        return (*list_unexplained(evidence, after, floors), *drifting, *downward_pulls(self.fit))

    def is_slight(self) -> bool:
        """Whether all that shows on frames that were searched is too little for a name."""
        return too_little_left(self.search, self.fit, self.search.fitted, (), everywhere=False)

    def rejected(self, before: Residuals) -> tuple[Rejected, ...]:
        """Rivals that lost, and effects that were tried and not accepted."""
        cropped = {i: before[i][:len(e.recorded)] for i, e in enumerate(self.looked_at)}
        return list_rejected(self.looked_at, self.fit, self.rounds, self.posteriors, cropped)

    def posterior(self, read_off: Sequence[ReadOff]) -> Posterior:
        """The joint posterior of the effects' parameters."""
        return posterior(self.fit, read_off)

    def ties(self) -> tuple[Tie, ...]:
        """Each finding and its likeliest rival, where that is worth an experiment."""
        return ties(self.nominal, self.fit, self.posteriors)


def explained_by_selection(problem: Problem) -> Selected:
    """Searches which effects explain the takes, compares them with their rivals and refines their numbers."""
    evaluator, progress = problem.evaluator, problem.progress
    residuals = dict(problem.residuals)
    looked_at = tuple(data_subset(rebalance(evaluator.evidence, residuals), residuals))
    chosen = select(Search(evaluator.on(looked_at), problem.nominal), problem.pool, progress, problem.thorough, problem.played)
    search, fit, posteriors = compare_models(chosen.search, chosen, progress)
    progress("numbers at a finer step", None)
    fit = search.refine(fit) if fit.effects else fit
    floors = search.floors(fit) if fit.effects else {}
    changing = drifts(search, fit)
    sure = calibrate(search, fit, posteriors, floors, [d.effect for d in changing], idle(search, fit))
    return Selected(problem.nominal, looked_at, chosen.missed, changing, chosen.stopped, problem.played, chosen.rounds, search,
                    fit, sure, floors)
