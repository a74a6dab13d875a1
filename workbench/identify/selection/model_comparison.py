"""How sure each effect is: its rivals put in its place, with all other effects in theirs, on all takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Report, Search, gained
from workbench.identify.fitting.responses import Part
from workbench.identify.options import CONCLUSIONS, FIT
from workbench.identify.parameters import Candidate, Key
from workbench.identify.selection.acceptance import explained_at_the_end
from workbench.identify.selection.forward import CLOSE, MOST_RIVALS
from workbench.identify.selection.record import SelectionResult, SelectionStep
from workbench.identify.selection.screening import CandidateFit

Array = NDArray[np.float64]
Seats = dict[Key, tuple[SelectionStep, CandidateFit]]
"""By effect, when it was taken and on what."""
TEMPER = 4.0
"""Neighbouring frames err alike: what chi squared differences are divided by when they become probabilities, where walks do not
tell."""
ROUGH = 0.015
"""The same as a share of an effect's gain: where that is more, walks leave more open."""
NEAR, NEAR_HELD = 400.0, 0.05
"""Of chi squared on the choosing stretches: a rival further behind at its place is not put in the effect's place; nor one that is
this share of the effect's gain behind (CLOSE where a walk in coarse steps said it)."""
BETTER = 30.0
"""Of the same: a twin that held takes find worse by this much is none; by more where the fit leaves more than a right model
does."""
LIKELIER = 0.5
"""A rival whose lead is this share of what leads are divided by is a fourth likelier, and takes an effect's place."""
NUMBER, NUMBER_SHARE = 40.0, 0.03
"""What each number that a name has more than another must bring, of the same: TEMPER times the logarithm of how many frames speak
(G. Schwarz, Annals of Statistics 6, 1978); at least this share of the effect's gain, as two engines, or a robot and a model,
differ by some hundredths of it, and a name with more numbers makes more of that."""
WALKS_SAY = 2 * TEMPER
"""The most of chi squared that walks add to what held takes say of a name: odds of e to one. Small differences send a walk
elsewhere, and a wrong name may happen to go that way.
"""
STEPS = 4
"""Of a fit: names that differ by little are told apart at their best alone."""
TWIN = 1.0 / 3.0
"""The least odds of a finding's twin that walks tell, where it came near enough to be put in its place, and of a name that held
takes find better but for the price of its numbers."""
CLOSED = ((0.9, 1.0), (0.75, 0.85), (0.5, 0.45))
"""Share of what was beyond noise at its place that an effect took away, and the factor on its confidence; LEAST below the last.
True effects close 97 % and more on a stand, 90 % on the ground; what the vocabulary lacks, its nearest name closes in part."""
LEAST = 0.2
SHAPE_END = 0.5
"""Doublings from its end at which a number that only shapes an effect hardly does so any more."""


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


def compare_models(search: Search, chosen: SelectionResult, report: Report) -> tuple[Search, Fit, list[NamePosterior]]:
    """The effects that stay, and how probable each is: a rival that does better in an effect's place takes it. The search as it
    is then."""
    fit = chosen.fit
    seats: Seats = {t.candidate.key: (r, t) for r in chosen.rounds for t in r.accepted}
    for turn in range(len(fit.effects) + 1):
        near = [_near(search, seats, fit.effects, c, x) for c, x in fit.sizes()]
        put = iter(search.side_by_side([_put(search, fit, i, t) for i, there in enumerate(near) for t in there],
                                       partial(report, f"rivals of {', '.join(map(str, fit.effects))}")))
        rivals = [[next(put) for _ in there] for there in near]
        challengers = [(_lead(search, fit, r, seats[c.key][1]) / _temper(search, fit, c, seats[c.key][1]), r, c)
                       for c, there in zip(fit.effects, rivals) for r in there]
        if turn == len(fit.effects) or not challengers:
            break
        lead, best, replaced = max(challengers, key=lambda challenger: challenger[0])
        if lead < LIKELIER:
            break
        r, _ = seats[replaced.key]
        seats[best.effects[-1].key] = r, next(t for t in r.trials if t.candidate.key == best.effects[-1].key)
        if search.is_settled(replaced):
            search, best = search.resettled(best, best.effects[-1])
        fit = search.refitted(best, search.fitted, STEPS)
    return search, fit, [_standing(search, fit, i, there, seats) for i, there in enumerate(rivals)]


def _standing(search: Search, fit: Fit, i: int, rivals: Sequence[Fit], seats: Seats) -> NamePosterior:
    taken = seats[fit.effects[i].key][1]
    walked = _walked(search, fit.effects[i], taken)
    temper = _temper(search, fit, fit.effects[i], taken)
    leads = np.array([0.0, *(_lead(search, fit, r, taken) for r in rivals)])
    twins = np.array([False, *(_twin(search, fit, i, r) if walked else _outbid(search, fit, i, r) for r in rivals)])
    weight = np.maximum(np.exp(0.5 * (leads - leads.max()) / temper), np.where(twins, TWIN, 0.0))
    p = weight / weight.sum()
    closed = explained_at_the_end(search, *seats[fit.effects[i].key], fit)
    sure = CONCLUSIONS.surest * next((factor for share, factor in CLOSED if closed >= share), LEAST)
    told = [Rival(r.effects[-1], r.x[r.slices()[-1]], float(r.cost["choose"] - fit.cost["choose"]), float(q) * sure, r)
            for r, q in zip(rivals, p[1:])]
    return NamePosterior(float(p[0]) * sure, tuple(sorted(told, key=lambda r: -r.probability)))


def _twin(search: Search, fit: Fit, i: int, rival: Fit) -> bool:
    """Whether a rival moves the robot as effect i does, and held takes do not tell which it is."""
    if rival.effects[-1].name not in fit.effects[i].effect.equivalent_to:
        return False
    return -_better(search, fit, rival, search.held) < BETTER * _misfit(search, fit)


def _walked(search: Search, c: Candidate, taken: CandidateFit) -> bool:
    """Whether walks tell an effect."""
    return taken.joint is None and search.evaluator.walks(search.fitted) and not search.is_settled(c)


def _temper(search: Search, fit: Fit, c: Candidate, taken: CandidateFit) -> float:
    """What leads of an effect's rivals are divided by when they become probabilities."""
    if _walked(search, c, taken):
        return max(FIT.overdispersion_free, ROUGH * taken.gain["choose"]) * _misfit(search, fit)
    return TEMPER * _misfit(search, fit, taken.joint)


def _misfit(search: Search, fit: Fit, joint: str | None = None) -> float:
    """What a fit leaves on the choosing stretches in shares of what a right model does, at least 1: by how much more than noise
    alone would have them chi squared differences are left to chance. joint: that was judged alone with the base held, and does
    not feel what goes wrong elsewhere."""
    if joint is None:
        return max(1.0, fit.cost["choose"] / max(1.0, search.evaluator.expected(search.fitted, "choose")))
    left, expected = search.evaluator.by_channel({i: fit.residuals[i] for i in search.held}, "choose", joint)
    return max(1.0, float(left.sum()) / max(1.0, float(expected.sum())))


def _lead(search: Search, fit: Fit, rival: Fit, taken: CandidateFit) -> float:
    """By how much a fit with a rival in an effect's place is better, of chi squared, numbers priced."""
    price = max(NUMBER, NUMBER_SHARE * taken.gain["choose"])
    own = [c.key for c in rival.effects]
    (replaced,) = (i for i, c in enumerate(fit.effects) if c.key not in own)
    return _ahead(search, fit, rival, replaced) + price * (_told(fit, replaced) - _told(rival, len(own) - 1))


def _ahead(search: Search, fit: Fit, rival: Fit, replaced: int) -> float:
    """The same, whatever numbers cost."""
    return _better_held(search, fit, rival) if search.is_settled(fit.effects[replaced]) else _better_by_both(fit, rival)


def _outbid(search: Search, fit: Fit, i: int, rival: Fit) -> bool:
    """Whether only the price of more numbers keeps a rival from effect i's place: a load that swings little is nearly a spring.
    Not one that is effect i with something added."""
    more = _told(rival, len(rival.effects) - 1) > _told(fit, i)
    return more and rival.effects[-1].effect.reduces_to != fit.effects[i].name and _ahead(search, fit, rival, i) > 0


def _better_by_both(fit: Fit, rival: Fit) -> float:
    """By how much a rival is better of an effect that all takes tell, of chi squared on the choosing stretches: twice as many are
    fitted, and say as much of each; what more numbers make of these is in their price."""
    return _by_both({use: fit.cost[use] - rival.cost[use] for use in ("choose", "fit")})


def _by_both(of: Mapping[str, float]) -> float:
    """Of chi squared, what both the fitted and the choosing stretches say, as much as the latter would."""
    return (of["choose"] + of["fit"] / 2) / 2


def _better_held(search: Search, fit: Fit, rival: Fit) -> float:
    """By how much a rival of an effect that held takes told is better: these take the word first."""
    walks = _better(search, fit, rival, search.floating_base(search.fitted)) * TEMPER / FIT.overdispersion_free
    return _better(search, fit, rival, search.held) + float(np.clip(walks, -WALKS_SAY, WALKS_SAY))


def _better(search: Search, fit: Fit, rival: Fit, takes: Sequence[int]) -> float:
    """How much less chi squared a rival leaves on these takes."""
    return gained(search.evaluator, fit, rival, takes, "choose")


def _told(fit: Fit, i: int) -> int:
    """Numbers of an effect that the data tell: where along its axis a joint carries a mass makes no name better. All of one that
    was too far behind to be fitted."""
    told = int(np.count_nonzero(np.isfinite(np.diag(fit.covariance)[fit.slices()[i]])))
    return told or fit.effects[i].size


def _near(search: Search, seats: Seats, effects: Sequence[Candidate], c: Candidate, x: Array) -> list[CandidateFit]:
    """Who came near an effect when it was taken, and is not among those that stay; its twin; what it is at its shape's end; where
    walks tell it, what moves another link's centre of mass, which tips the robot as much once it is fitted to its end."""
    r, trial = seats[c.key]
    taken = {e.key for e in effects}
    reach = max(NEAR, (CLOSE if trial.joint is None else NEAR_HELD) * trial.gain["choose"])
    there = [t for t in r.rivals(trial) if t.candidate.key not in taken]
    alike = {(name, c.where) for name in c.effect.equivalent_to if trial.joint is None}
    if _at_its_end(c, x):
        alike.add((c.effect.reduces_to, c.where))
    tips = _walked(search, c, trial) and c.effect.layer == "inertia"
    always = [t for t in there if t.candidate.key in alike
              or (tips and not t.screened_out and t.candidate.effect.moves_center and t.candidate.where != c.where)]
    return always + [t for t in there if not t.screened_out and t not in always and _behind(trial, t) < reach][:MOST_RIVALS]


def _behind(trial: CandidateFit, t: CandidateFit) -> float:
    """By how much a rival was behind; where all channels of a walk judge, what was fitted says as much as what was not."""
    behind = {use: trial.gain[use] - t.gain[use] for use in trial.gain}
    return min(behind["choose"], _by_both(behind)) if trial.joint is None else behind["choose"]


def _at_its_end(c: Candidate, x: Array) -> bool:
    """Whether a number that only shapes an effect, if there is one, is as far as it may go."""
    low, high = c.bounds()
    return not c.shapes.any() or bool(np.any(c.shapes & ((x < low + SHAPE_END) | (x > high - SHAPE_END))))


def _put(search: Search, fit: Fit, i: int, rival: CandidateFit) -> Part[Fit]:
    """The fit with a rival in effect i's place and its numbers fitted there, with those of others in its joint where held takes
    tell them; the same effect elsewhere begins at the size that the other has, and what the other becomes where that does the
    same, if that is better."""
    others = [s for j, s in enumerate(fit.sizes()) if j != i]
    own, size = fit.sizes()[i]
    alike = (rival.candidate.name, rival.candidate.size) == (own.name, own.size)
    starts = [rival.x, np.clip(size, *rival.candidate.bounds())] if alike else [rival.x]
    values = own.effect.as_other(rival.candidate.name, own.spec(size), search.nominal)
    if values and rival.candidate.where == own.where:
        starts.append(rival.candidate.sizes(values))
    there = min((yield from search.evaluating(*([*others, (rival.candidate, x)] for x in starts))), key=lambda f: f.cost["fit"])
    if there.cost["choose"] - fit.cost["choose"] > max(2 * NEAR, 2 * CLOSE * rival.gain["choose"]):
        return there
    held = search.told_by_fixed_base(own)
    takes = search.held if held else search.fitted
    beside = [j for j, (c, _) in enumerate(others) if held and (search.single_joint or c.joint == own.joint)]
    return (yield from search.refitting(there, takes, STEPS, free=[*beside, len(others)]))
