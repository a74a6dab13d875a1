"""How sure each effect is: its rivals put in its place, with all other effects in theirs, on all takes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from workbench.gap.candidates import Candidate
from workbench.gap.covariance import TEMPER_WALKING, WIDER, Z90
from workbench.gap.evidence import joint_of, ratios
from workbench.gap.race import Part, Trial
from workbench.gap.rounds import Chosen, Round
from workbench.gap.search import Fit, Report, Search
from workbench.gap.selection import CLOSE, MOST_RIVALS, completed

Array = NDArray[np.float64]
Seats = dict[tuple[str, tuple[str, ...]], tuple[Round, Trial]]
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
"""Of the same: a rival that does better by this much takes an effect's place; by more where the fit leaves more than a right
model does."""
NUMBER, NUMBER_SHARE = 40.0, 0.03
"""What each number that a name has more than another must bring, of the same: TEMPER times the logarithm of how many frames speak
(G. Schwarz, Annals of Statistics 6, 1978); at least this share of the effect's gain, as two engines, or a robot and a model,
differ by some hundredths of it, and a name with more numbers makes more of that."""
STEPS = 4
"""Of a fit: names that differ by little are told apart at their best alone."""
SUREST = 0.98
"""What no finding exceeds: physics that the vocabulary lacks can look like any of it."""
CLOSED = ((0.9, 1.0), (0.75, 0.85), (0.5, 0.45))
"""Share of what was beyond noise at its place that an effect took away, and the factor on its confidence; LEAST below the last.
True effects close 97 % and more on a stand, 90 % on the ground; what the vocabulary lacks, its nearest name closes in part."""
LEFT = ((1.5, 1.0), (2.5, 0.7), (6.0, 0.4))
"""RMS over sigma that held takes leave in some channel there at the end, and the factor for that; LEAST beyond the last. A large
gap may be closed by 97 % and still leave ten times the noise: something else acts there."""
CHANGING = 0.5
"""The factor for an effect whose numbers would have to change within a take: something else that does so looks like it."""
LEAST = 0.2
SHAPE_END = 0.5
"""Doublings from its end at which a number that only shapes an effect hardly does so any more."""
ALIKE_FLOOR, HARDLY = 0.15, 0.5
"""By how much [a logarithm] a floor's friction has to differ from the model's, and the factor for one that differs by less: of
robots that lack nothing, played by another engine, walks want up to 5 % more, and a mass that swings looks like 12 % more. The
same for a number that would go further if it might, or may be nothing: it makes up for something else."""


@dataclass(frozen=True)
class Rival:
    """Another name for a finding. gain: of chi squared on the choosing stretches, less than the finding's by `behind`."""

    candidate: Candidate
    x: Array
    behind: float
    probability: float
    fit: Fit | None = None


@dataclass(frozen=True)
class Standing:
    """A finding's probability and its rivals, the likeliest first."""

    probability: float
    rivals: tuple[Rival, ...]


def contest(search: Search, chosen: Chosen, report: Report) -> tuple[Fit, list[Standing]]:
    """The effects that stay, and the standing of each: a rival that does better in an effect's place takes it."""
    fit = chosen.fit
    seats: Seats = {t.candidate.key: (r, t) for r in chosen.rounds for t in r.accepted}
    for turn in range(len(fit.effects) + 1):
        near = [_near(seats, fit.effects, c, x) for c, x in fit.sizes()]
        put = iter(search.side_by_side([_put(search, fit, i, t) for i, there in enumerate(near) for t in there],
                                       partial(report, f"rivals of {', '.join(map(str, fit.effects))}")))
        rivals = [[next(put) for _ in there] for there in near]
        challengers = [(_lead(fit, r, seats[c.key][1]), r, c) for c, there in zip(fit.effects, rivals) for r in there]
        if turn == len(fit.effects) or not challengers:
            break
        lead, best, replaced = max(challengers, key=lambda challenger: challenger[0])
        if lead < BETTER * _misfit(search, fit):
            break
        r, _ = seats[replaced.key]
        seats[best.effects[-1].key] = r, next(t for t in r.trials if t.candidate.key == best.effects[-1].key)
        if search.is_settled(replaced):
            best = search.resettled(best, best.effects[-1])
        fit = search.refitted(best, search.fitted, STEPS)
    return fit, [_standing(search, fit, i, there, seats) for i, there in enumerate(rivals)]


def doubted(search: Search, fit: Fit, standings: Sequence[Standing], floors: Mapping[int, Array],
            changing: Collection[Candidate] = ()) -> list[Standing]:
    """Standings less sure where held takes, which told the effect, leave much at its place, or want its numbers to change; of the
    whole robot at joints that no other effect is to answer for; where a floor is nearly the model's, a number as far as it may
    go, or nothing within its interval. floors: of the fit, by take."""
    left = [(channel, r) for i in search.held if i in floors
            for channel, r in ratios(search.jury.evidence[i], fit.residuals[i] / np.hypot(1.0, floors[i]), "choose").items()]
    out, theirs = [], {c.joint for c in fit.effects}
    for (c, x), own_x, s in zip(fit.sizes(), fit.slices(), standings):
        told_held = search.is_settled(c) or search.held == search.fitted
        own = [r for channel, r in left if joint_of(channel) == c.joint or (c.joint is None and joint_of(channel) not in theirs)]
        worst = max((r for r in own if told_held and r == r), default=0.0)
        factor = next((factor for most, factor in LEFT if worst <= most), LEAST) * (CHANGING if c in changing else 1.0)
        slight = _hardly_another_floor(c, x) or _at_its_limit(c, x) or _may_be_nothing(c, x, fit.covariance[own_x, own_x])
        factor *= HARDLY if slight else 1.0
        out.append(Standing(factor * s.probability, tuple(replace(r, probability=factor * r.probability) for r in s.rivals)))
    return out


def _hardly_another_floor(c: Candidate, x: Array) -> bool:
    """Whether an effect only changes a friction of feet and floor, by less than engines differ there."""
    if c.effect.layer != "ground" or not c.parameters[0].replaces:
        return False
    return bool(abs(np.log(c.values(x)[0] / c.neutral[0])) < ALIKE_FLOOR)


def _may_be_nothing(c: Candidate, x: Array, covariance: Array) -> bool:
    """Whether the 90 % intervals of all numbers that make an effect, a point mass's of its mass, hold what it vanishes at."""
    half = Z90 * WIDER * np.sqrt(np.diag(covariance))
    makes = ~c.shapes & np.isfinite(half)
    if c.point_mass:
        makes[1:] = False
    return not c.read_off and bool(makes.any()) and bool(np.all(np.abs(x) < half, where=makes))


def _at_its_limit(c: Candidate, x: Array) -> bool:
    """Whether a number is at the end of what is possible, away from where the effect vanishes."""
    return not c.read_off and any(np.any(np.isclose(x, end, rtol=1e-3) & (end != 0) & ~c.shapes) for end in c.bounds())


def _standing(search: Search, fit: Fit, i: int, rivals: Sequence[Fit], seats: Seats) -> Standing:
    taken = seats[fit.effects[i].key][1]
    walked = taken.joint is None and search.jury.walks(search.fitted) and not search.is_settled(fit.effects[i])
    temper = max(TEMPER_WALKING, ROUGH * taken.gain["choose"]) if walked else TEMPER
    temper *= _misfit(search, fit)
    leads = np.array([0.0, *(_lead(fit, r, taken) for r in rivals)])
    weight = np.exp(0.5 * (leads - leads.max()) / temper)
    p = weight / weight.sum()
    closed = completed(search, *seats[fit.effects[i].key], fit)
    sure = SUREST * next((factor for share, factor in CLOSED if closed >= share), LEAST)
    told = [Rival(r.effects[-1], r.x[r.slices()[-1]], float(r.cost["choose"] - fit.cost["choose"]), float(q) * sure, r)
            for r, q in zip(rivals, p[1:])]
    return Standing(float(p[0]) * sure, tuple(sorted(told, key=lambda r: -r.probability)))


def _misfit(search: Search, fit: Fit) -> float:
    """What a fit leaves on the choosing stretches in shares of what a right model does, at least 1: by how much more than noise
    alone would have them chi squared differences are left to chance."""
    return max(1.0, fit.cost["choose"] / max(1.0, search.jury.expected(search.fitted, "choose")))


def _lead(fit: Fit, rival: Fit, taken: Trial) -> float:
    """By how much a fit with a rival in an effect's place is better, of chi squared, numbers priced."""
    price = max(NUMBER, NUMBER_SHARE * taken.gain["choose"])
    own = [c.key for c in rival.effects]
    (replaced,) = (i for i, c in enumerate(fit.effects) if c.key not in own)
    return fit.cost["choose"] - rival.cost["choose"] + price * (_told(fit, replaced) - _told(rival, len(own) - 1))


def _told(fit: Fit, i: int) -> int:
    """Numbers of an effect that the data tell: where along its axis a joint carries a mass makes no name better."""
    return int(np.count_nonzero(np.isfinite(np.diag(fit.covariance)[fit.slices()[i]])))


def _near(seats: Seats, effects: Sequence[Candidate], c: Candidate, x: Array) -> list[Trial]:
    """Who came near an effect when it was taken, and is not among those that stay; and what it is at the end of its shape."""
    r, trial = seats[c.key]
    taken = {e.key for e in effects}
    reach = max(NEAR, (CLOSE if trial.joint is None else NEAR_HELD) * trial.gain["choose"])
    there = [t for t in r.rivals(trial) if t.candidate.key not in taken]
    plain = [t for t in there if t.candidate.key == (c.effect.limit, c.where) and _at_its_end(c, x)]
    return plain + [t for t in there if not t.foretold and t not in plain
                    and trial.gain["choose"] - t.gain["choose"] < reach][:MOST_RIVALS]


def _at_its_end(c: Candidate, x: Array) -> bool:
    """Whether a number that only shapes an effect is as far as it may go."""
    low, high = c.bounds()
    return bool(np.any(c.shapes & ((x < low + SHAPE_END) | (x > high - SHAPE_END))))


def _put(search: Search, fit: Fit, i: int, rival: Trial) -> Part[Fit]:
    """The fit with a rival in effect i's place and its numbers fitted there; the same effect elsewhere begins at the size that
    the other has, if that is better."""
    others = [s for j, s in enumerate(fit.sizes()) if j != i]
    own, size = fit.sizes()[i]
    starts = [rival.x, np.clip(size, *rival.candidate.bounds())] if rival.candidate.name == own.name else [rival.x]
    there = min((yield from search.evaluating(*([*others, (rival.candidate, x)] for x in starts))), key=lambda f: f.cost["fit"])
    if there.cost["choose"] - fit.cost["choose"] > max(2 * NEAR, 2 * CLOSE * rival.gain["choose"]):
        return there
    takes = search.held if search.is_settled(fit.effects[i]) else search.fitted
    return (yield from search.refitting(there, takes, STEPS, free=[len(others)]))
