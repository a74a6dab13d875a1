"""Probability of each effect: compared with rivals that replace it, with all other effects refitted, on all takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.options import CONCLUSIONS
from workbench.identify.parameters import Candidate
from workbench.identify.selection.acceptance import explained_at_the_end
from workbench.identify.selection.odds import chi_squared_lead, dispersion, is_by_floating_base, is_equivalent, is_outpriced
from workbench.identify.selection.options import COMPARISON, RIVAL
from workbench.identify.selection.record import SelectionResult
from workbench.identify.selection.rivals import TakenIn, replace_effect, rivals_near
from workbench.types import Array, Progress


@dataclass(frozen=True)
class Rival:
    """Another name for a finding. gain: of chi squared on the choosing stretches, less than the finding's by `behind`."""

    candidate: Candidate
    x: Array
    behind: float
    probability: float
    fit: Fit | None = None


@dataclass(frozen=True)
class NamePosterior:
    """A finding's probability and its rivals, the likeliest first."""

    probability: float
    rivals: tuple[Rival, ...]


def compare_models(search: Search, chosen: SelectionResult, report: Progress) -> tuple[Search, Fit, list[NamePosterior]]:
    """The effects that stay, and how probable each is: a rival that does better in an effect's place takes it. The search as it
    is then."""
    fit = chosen.fit
    taken_in: TakenIn = {t.candidate.key: (r, t) for r in chosen.rounds for t in r.accepted}
    for turn in range(len(fit.effects) + 1):
        near = [rivals_near(search, taken_in, fit.effects, c, x) for c, x in fit.sizes()]
        put = iter(search.side_by_side([replace_effect(search, fit, i, t) for i, there in enumerate(near) for t in there],
                                       partial(report, f"rivals of {', '.join(map(str, fit.effects))}")))
        rivals = [[next(put) for _ in there] for there in near]
        challengers = [(chi_squared_lead(search, fit, r, taken) / dispersion(search, fit, c, taken), r, c)
                       for c, there in zip(fit.effects, rivals) for taken in (taken_in[c.key][1],) for r in there]
        if turn == len(fit.effects) or not challengers:
            break
        lead, best, replaced = max(challengers, key=lambda challenger: challenger[0])
        if lead < COMPARISON.likelier:
            break
        r, _ = taken_in[replaced.key]
        taken_in[best.effects[-1].key] = r, next(t for t in r.trials if t.candidate.key == best.effects[-1].key)
        if search.is_settled(replaced):
            search, best = search.resettle(best, best.effects[-1])
        fit = search.refit(best, search.fitted, RIVAL.steps)
    return search, fit, [_posterior(search, fit, i, there, taken_in) for i, there in enumerate(rivals)]


def _posterior(search: Search, fit: Fit, i: int, rivals: Sequence[Fit], taken_in: TakenIn) -> NamePosterior:
    taken = taken_in[fit.effects[i].key][1]
    walked = is_by_floating_base(search, fit.effects[i], taken)
    temper = dispersion(search, fit, fit.effects[i], taken)
    leads = np.array([0.0, *(chi_squared_lead(search, fit, r, taken) for r in rivals)])
    stays = is_equivalent if walked else is_outpriced
    equivalents = np.array([False, *(stays(search, fit, i, r) for r in rivals)])
    weight = np.maximum(np.exp(0.5 * (leads - leads.max()) / temper), np.where(equivalents, COMPARISON.least_equivalent, 0.0))
    p = weight / weight.sum()
    closed = explained_at_the_end(search, *taken_in[fit.effects[i].key], fit)
    sure = CONCLUSIONS.surest * next((factor for share, factor in COMPARISON.closed if closed >= share), COMPARISON.least)
    others = [Rival(r.effects[-1], r.x[r.slices()[-1]], float(r.cost["choose"] - fit.cost["choose"]), float(q) * sure, r)
            for r, q in zip(rivals, p[1:])]
    return NamePosterior(float(p[0]) * sure, tuple(sorted(others, key=lambda r: -r.probability)))
