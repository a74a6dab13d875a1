"""Probability of each effect: compared with rivals that replace it, with all other effects refitted, on all takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.fitting.responses import Part
from workbench.identify.options import CONCLUSIONS
from workbench.identify.parameters import Candidate, Key
from workbench.identify.selection.acceptance import explained_at_the_end
from workbench.identify.selection.odds import (
    by_both,
    chi_squared_lead,
    dispersion,
    is_by_floating_base,
    is_equivalent,
    is_outpriced,
)
from workbench.identify.selection.options import COMPARISON, FORWARD
from workbench.identify.selection.record import CandidateFit, SelectionResult, SelectionStep
from workbench.types import Array, Progress

TakenIn = dict[Key, tuple[SelectionStep, CandidateFit]]
"""By effect, when it was taken and on what."""


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
        fit = search.refit(best, search.fitted, COMPARISON.steps)
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


def rivals_near(search: Search, taken_in: TakenIn, effects: Sequence[Candidate], c: Candidate, x: Array) -> list[CandidateFit]:
    """Rivals that came close to an effect when it was accepted, and are not in the model; its equivalent effect; the limiting
    case of its shape; where floating-base takes identify it, displaced centres of mass of other links, which tip the robot as
    much once they are fitted to the end."""
    r, trial = taken_in[c.key]
    taken = {e.key for e in effects}
    reach = max(COMPARISON.near, (FORWARD.close if trial.joint is None else COMPARISON.near_fixed) * trial.gain["choose"])
    there = [t for t in r.rivals(trial) if t.candidate.key not in taken]
    alike = {(name, c.where) for name in c.effect.equivalent_to if trial.joint is None}
    if _at_its_end(c, x):
        alike.add((c.effect.reduces_to, c.where))
    tips = is_by_floating_base(search, c, trial) and c.effect.layer == "inertia"
    always = [t for t in there if t.candidate.key in alike
              or (tips and not t.screened_out and t.candidate.effect.moves_center and t.candidate.where != c.where)]
    near = [t for t in there if not t.screened_out and t not in always and _behind(trial, t) < reach]
    return always + near[:FORWARD.most_rivals]


def _behind(trial: CandidateFit, t: CandidateFit) -> float:
    """Deficit of a rival; where all channels of a walk judge, a prediction counts as much as a fit."""
    behind = {use: trial.gain[use] - t.gain[use] for use in trial.gain}
    return min(behind["choose"], by_both(behind)) if trial.joint is None else behind["choose"]


def _at_its_end(c: Candidate, x: Array) -> bool:
    """Whether a number that only shapes an effect, if there is one, is as far as it may go."""
    low, high = c.bounds()
    return not c.shapes.any() or bool(np.any(c.shapes & ((x < low + COMPARISON.shape_end) | (x > high - COMPARISON.shape_end))))


def replace_effect(search: Search, fit: Fit, i: int, rival: CandidateFit) -> Part[Fit]:
    """The fit with a rival in place of effect i and its parameters fitted, together with those of others in its joint where
    fixed-base takes identify them; the same effect elsewhere starts from the size of the other, and a rival from the equivalent
    values, if that is better."""
    others = [s for j, s in enumerate(fit.sizes()) if j != i]
    own, size = fit.sizes()[i]
    alike = (rival.candidate.name, rival.candidate.size) == (own.name, own.size)
    starts = [rival.x, np.clip(size, *rival.candidate.bounds())] if alike else [rival.x]
    values = own.effect.as_other(rival.candidate.name, own.spec(size), search.nominal)
    if values and rival.candidate.where == own.where:
        starts.append(rival.candidate.sizes(values))
    there = min((yield from search.evaluating(*([*others, (rival.candidate, x)] for x in starts))), key=lambda f: f.cost["fit"])
    if there.cost["choose"] - fit.cost["choose"] > max(2 * COMPARISON.near, 2 * FORWARD.close * rival.gain["choose"]):
        return there
    fixed = search.identified_on_fixed_base(own)
    takes = search.fixed_base if fixed else search.fitted
    beside = [j for j, (c, _) in enumerate(others) if fixed and c.joint == own.joint]
    return (yield from search.refitting(there, takes, COMPARISON.steps, free=[*beside, len(others)]))
