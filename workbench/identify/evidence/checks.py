"""Checks that can refute an effect of the most probable model, compared with other models: each names it, and the reason."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from workbench.identify.evidence.fit import Fitted
from workbench.identify.evidence.holdout import folds_of, veto
from workbench.identify.evidence.nested import improbable_effects
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.plausible import at_their_end
from workbench.identify.evidence.region import Region
from workbench.identify.evidence.search import Found, lockstep
from workbench.identify.fitting.doubts import Drift, drift, trends
from workbench.identify.options import PROBLEM
from workbench.identify.parameters import Candidate
from workbench.identify.problem import TakeEvidence
from workbench.identify.results.reasons import Reason, SpokenAgainst
from workbench.types import Progress

if TYPE_CHECKING:
    from workbench.identify.evidence.rollouts import Rollouts

Refuted = Mapping[Candidate, Reason]
Check = Callable[["Rollouts", Sequence[Found]], list[Refuted]]
"""By region, the effects of its best fit that are refuted."""


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
