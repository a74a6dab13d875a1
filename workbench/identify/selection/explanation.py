"""Takes explained by forward selection: searched on a part of long sessions, compared with rivals, numbers refined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.identify.conclusions import ReadOff, Residuals, change, estimates, list_unexplained, value_slopes, with_read_off
from workbench.identify.estimators.dropped_commands import TakesAsPlayed, with_commands_of
from workbench.identify.fitting.doubts import downward_pulls, drifts
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.options import CONCLUSIONS, PROBLEM
from workbench.identify.parameters import Candidate
from workbench.identify.problem import TakeEvidence
from workbench.identify.results.findings import Alternative, FamilyBelief, Finding, Rejected, Unexplained
from workbench.identify.results.reasons import Outdone, Reason, ScreenedOut, TooLittle, WorseInPlace
from workbench.identify.results.ties import Tie
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.identify.search_result import Problem, SearchResult
from workbench.identify.selection.acceptance import idle, too_little_left
from workbench.identify.selection.calibration import calibrate
from workbench.identify.selection.forward import select
from workbench.identify.selection.model_comparison import NamePosterior, Rival, compare_models
from workbench.identify.selection.record import CandidateFit, SelectionStep
from workbench.identify.subset import data_subset, floors_everywhere, rebalance
from workbench.robot import Posterior, RobotModel
from workbench.robot.model_file import parameter_names
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
        """Joint posterior in the units of docs/formats.md; variances by the local slope between a size and its value."""
        fit = self.fit
        if not fit.effects:
            return with_read_off(Posterior(), read_off)
        names = list(parameter_names([c.spec(x) for c, x in fit.sizes()]))
        mean = np.concatenate([c.values(x) for c, x in fit.sizes()])
        slopes = np.zeros((len(mean), len(fit.x)))
        for c, s, row in zip(fit.effects, fit.slices(), np.cumsum([0, *(len(c.neutral) for c in fit.effects)])):
            slopes[row:row + len(c.neutral), s] = value_slopes(c, fit.x[s])
        known = np.isfinite(np.diag(fit.covariance))
        inner = CONCLUSIONS.wider**2 * np.where(np.outer(known, known), np.nan_to_num(fit.covariance, posinf=0.0), 0.0)
        covariance = slopes @ inner @ slopes.T
        lost = np.any(slopes[:, ~known] != 0, axis=1) | ~np.any(slopes != 0, axis=1)
        covariance[lost] = covariance[:, lost] = np.inf
        spread = np.concatenate([c.spread or np.zeros(len(c.neutral)) for c in fit.effects])
        for k in np.flatnonzero(spread):
            covariance[k] = covariance[:, k] = 0.0
            covariance[k, k] = spread[k] ** 2
        return with_read_off(Posterior(tuple(names), mean, covariance), read_off)

    def ties(self) -> tuple[Tie, ...]:
        """Each finding and its likeliest rival, where that was fitted and is worth an experiment."""
        return tuple(Tie(self.fit.model(self.nominal), s.rivals[0].fit.model(self.nominal), s.rivals[0].probability)
                     for s in self.posteriors if s.rivals and s.rivals[0].fit is not None
                     and s.rivals[0].probability > CONCLUSIONS.worth_an_experiment)


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
    return Selected(nominal=problem.nominal, looked_at=looked_at, missed=chosen.missed, drifts=changing, stopped=chosen.stopped,
                    played=problem.played, rounds=chosen.rounds, search=search, fit=fit, posteriors=sure, floors=floors)


def finding(evidence: Sequence[TakeEvidence], fit: Fit, i: int, posterior: NamePosterior, before: Residuals, after: Residuals
            ) -> Finding:
    """Effect i of a fit, at all places that the data cannot tell apart, the likeliest first. before, after: residuals by take of
    the nominal and the fitted model."""
    c, x = fit.sizes()[i]
    elsewhere = _elsewhere(c, posterior)
    where = (*c.where, *(place for r in elsewhere for place in r.candidate.where))
    others = [r for r in posterior.rivals if r not in elsewhere]
    likely = next((r for r in others if r.probability >= 0.01), None)
    alternatives = () if likely is None else (Alternative(likely.candidate.name, likely.candidate.where, likely.probability),)
    own = fit.slices()[i]
    numbers = estimates(c, x, fit.covariance[own, own])
    confidence = posterior.probability + sum(r.probability for r in elsewhere)
    return Finding(
        effect=c.name, where=where, confidence=confidence, parameters=numbers,
        alternatives=alternatives, fit=change(evidence, where, before, after, "fit"),
        validation=change(evidence, where, before, after, "validate"), evidence=c.effect.sentence(c.spec(x)),
        family=_family(c, confidence, others))


def _family(c: Candidate, confidence: float, others: Sequence[Rival]) -> FamilyBelief | None:
    """An effect's family, if it has one, with the probability of rivals of the same family at its joint or link, or of the whole
    robot, added."""
    family = c.effect.family
    if family is None:
        return None
    alike = (r.probability for r in others if r.candidate.effect.family == family and r.candidate.where in (c.where, ()))
    return FamilyBelief(family, confidence + sum(alike))


def _elsewhere(c: Candidate, posterior: NamePosterior) -> list[Rival]:
    """The same effect at other places that the data cannot tell from this one."""
    least = CONCLUSIONS.same_elsewhere * posterior.probability
    return [r for r in posterior.rivals if r.candidate.name == c.name and r.probability >= least]


def list_rejected(evidence: Sequence[TakeEvidence], fit: Fit, rounds: Sequence[SelectionStep],
                  posteriors: Sequence[NamePosterior], before: Residuals) -> tuple[Rejected, ...]:
    """Rivals that were fitted and lost, and why: each replacement of a finding with its residuals on unseen stretches."""
    unseen = any(e.uses["validate"].any() for e in evidence)
    kept = {c.key for c in fit.effects} | {r.candidate.key for c, s in zip(fit.effects, posteriors) for r in _elsewhere(c, s)}
    out: dict[object, Rejected] = {}
    for c, posterior in zip(fit.effects, posteriors):
        for rival in posterior.rivals:
            if rival.candidate.key not in kept and rival.fit is not None:
                left = change(evidence, rival.candidate.where, before, rival.fit.residuals, "validate") if unseen else None
                out[rival.candidate.key] = Rejected(rival.candidate.name, rival.candidate.where,
                                                    WorseInPlace(c.name, c.where, rival.behind), left)
    for r in rounds:
        for t in r.trials:
            key = t.candidate.key
            if key in kept or key in out:
                continue
            out[key] = Rejected(t.candidate.name, t.candidate.where, _why_not(r, t))
    return tuple(out.values())


def _why_not(r: SelectionStep, t: CandidateFit) -> Reason:
    """Why an effect that was tried in a round was not taken."""
    best = next((a for a in r.accepted if t.joint in (None, a.joint) or a.joint is None), None)
    if t.screened_out:
        return ScreenedOut(*t.promised)
    if best is None:
        return TooLittle()
    return Outdone(best.candidate.name, best.candidate.where, best.gain["choose"], t.gain["choose"])
