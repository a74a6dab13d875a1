"""Checks that can refute an effect of the most probable model, compared with other models: each names it, and the reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from workbench.identify.evidence.fit import Asks, Fitted, drop_effects, fit_hypothesis
from workbench.identify.evidence.hypothesis import Hypothesis
from workbench.identify.evidence.nested import improbable_effects
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.plausible import at_their_end
from workbench.identify.evidence.region import Region
from workbench.identify.evidence.search import Found, lockstep
from workbench.identify.fitting.doubts import Drift, drift, trends
from workbench.identify.fitting.lockstep import side_by_side, through
from workbench.identify.options import PROBLEM
from workbench.identify.parameters import Candidate
from workbench.identify.problem import TakeEvidence
from workbench.identify.results.reasons import Reason, SpokenAgainst
from workbench.types import Array, Progress

if TYPE_CHECKING:
    from workbench.identify.evidence.rollouts import Rollouts

Refuted = Mapping[Candidate, Reason]
Check = Callable[["Rollouts", Sequence[Found]], list[Refuted]]
"""By region, the effects of its best fit that are refuted."""
MOST_FOLDS = 4
"""Takes that differ in nothing are kept back in so many groups: each costs a fit of every effect."""
EXCITED = 0.1
"""Share of what all takes tell of an effect that the others have to tell, to judge it by those kept back: who never saw full duty
cannot know where it ends."""


def checks(pool: Sequence[Candidate], evidence: Sequence[TakeEvidence], options: EvidenceOptions, progress: Progress
           ) -> tuple[Check, ...]:
    """The cheapest first. pool: candidates as far as this robot lets them go."""

    def plausible(rollouts: Rollouts, found: Sequence[Found]) -> list[Refuted]:
        return [at_their_end(f.best.hypothesis, pool) for f in found]

    def more_than_nothing(rollouts: Rollouts, found: Sequence[Found]) -> list[Refuted]:
        objections = lockstep(rollouts, {k: improbable_effects(f.region, options, f.best) for k, f in enumerate(found)})
        return [objections[k] for k in range(len(found))]

    def kept_back(rollouts: Rollouts, found: Sequence[Found]) -> list[Refuted]:
        progress("takes kept back", None)
        folds = [folds_of(evidence, [p.take for p in f.region.parts]) for f in found]
        fits = {k: veto(f.region, options, f.best, fold) for k, (f, fold) in enumerate(zip(found, folds))
                if f.best.hypothesis.effects and fold}
        objections = lockstep(rollouts, fits)
        return [{c: SpokenAgainst(-gain) for c, gain in objections.get(k, {}).items()} for k in range(len(found))]

    return plausible, more_than_nothing, kept_back


def refute(tried: Sequence[Check], rollouts: Rollouts, found: Sequence[Found]) -> list[Refuted]:
    """Result of the first check that refutes anything; empty where none does."""
    return next((objections for objections in (check(rollouts, found) for check in tried) if any(objections)), [])


def drifts(region: Region, fit: Fitted, evidence: Sequence[TakeEvidence]) -> list[Drift]:
    """Parameters of a fit's effects that a region's takes tell differently early and late."""
    clocks, stretches = [], []
    for p in region.parts:
        since = evidence[p.take].since
        stretch = p.take * PROBLEM.most_stretches + np.floor(since / PROBLEM.block).astype(int)
        clocks.append(np.broadcast_to((since / since[-1] - 0.5)[p.rows, None], p.seen.shape)[p.seen])
        stretches.append(np.broadcast_to(stretch[p.rows, None], p.seen.shape)[p.seen])
    if not clocks or not fit.hypothesis.effects:
        return []
    weight, clock = np.sqrt(region.likelihood.precision(fit.r, fit.discrepancy)), np.concatenate(clocks)
    own = [(c, x, k) for c, x in fit.hypothesis.sizes() for k in range(c.size)]
    first, out = len(fit.hypothesis.numbers), list[Drift]()
    for t in trends(weight * fit.r, weight[:, None] * fit.J, clock, np.concatenate(stretches)):
        if t.column >= first:
            makes = fit.J[:, t.column] * clock / region.likelihood.known
            found = drift(*own[t.column - first], t._replace(rms=float(np.sqrt(np.mean(np.square(makes))))))
            out += [] if found is None else [found]
    return out


def folds_of(evidence: Sequence[TakeEvidence], takes: Sequence[int]) -> list[tuple[int, ...]]:
    """Groups of takes to be kept back in turn: by what differs in the servos' constants (the gain) where anything does, else
    take by take. Empty where there is one take alone."""
    groups: dict[str, list[int]] = {}
    for i in takes:
        groups.setdefault(evidence[i].take.spec.conditions, []).append(i)
    if len(groups) > 1:
        return [tuple(g) for g in groups.values()]
    if len(takes) < 2:
        return []
    n = min(MOST_FOLDS, len(takes))
    return [tuple(takes[k::n]) for k in range(n)]


def veto(region: Region, options: EvidenceOptions, best: Fitted, folds: Sequence[tuple[int, ...]]
         ) -> Asks[dict[Candidate, float]]:
    """The effects of a fit that held-out takes contradict, with the evidence against each [nats]: log likelihood of the held-out
    takes, of the fit with the effect and without, each fitted to the other takes; summed over the folds that can decide. An
    effect that makes unseen takes less likely is none, however much it explains of those seen."""
    effects = best.hypothesis.effects
    gains = dict.fromkeys(range(len(effects)), 0.0)
    for fold in folds:
        seen = region.of_takes([i for i in {p.take for p in region.parts} if i not in fold])
        unseen = region.of_takes(fold)
        telling = [k for k in range(len(effects)) if _is_excited(region, seen, best, k)]
        if not telling:
            continue
        states = [(best.hypothesis, best.J)] + [drop_effects(best, lambda c, k=k: c is effects[k]) for k in telling]
        fits = yield from side_by_side([_fold(region, seen, options, h, best.discrepancy, J) for h, J in states])
        left = yield [f.hypothesis for f in fits]
        logs = [unseen.likelihood.log(r[region.of(fold)], f.discrepancy) for f, r in zip(fits, left)]
        for k, log in zip(telling, logs[1:]):
            gains[k] += logs[0] - log
    return {effects[k]: gain for k, gain in gains.items() if gain < -options.veto}


def _fold(region: Region, seen: Region, options: EvidenceOptions, h: Hypothesis, s: float, J: Array) -> Asks[Fitted]:
    """A fit to the takes that are not held out; its requests are rolled out on all of them."""
    mine = region.of([p.take for p in seen.parts])
    part = fit_hypothesis(seen, options, h, s, options.iterations, None, J[mine])
    return (yield from through(part, lambda asked: asked, lambda r: r[mine]))


def _is_excited(region: Region, seen: Region, best: Fitted, k: int) -> bool:
    """Whether the takes that are seen tell enough of an effect."""
    own = best.hypothesis.slices()[k]
    information = np.sum(np.square(best.J[:, own]) * region.likelihood.precision(best.r, best.discrepancy)[:, None], axis=1)
    return bool(information[region.of([p.take for p in seen.parts])].sum() >= EXCITED * information.sum())
