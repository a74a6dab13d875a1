"""How sure each effect is: its rivals put in its place, with all other effects in theirs, on all takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.gap.candidates import Candidate
from workbench.gap.race import Trial
from workbench.gap.search import Fit, Report, Search
from workbench.gap.selection import Chosen, Round, completed

Array = NDArray[np.float64]
TEMPER = 4.0
"""Neighbouring frames err alike, and engines differ: chi squared differences count a quarter when they become probabilities."""
NEAR = 400.0
"""Of chi squared on the choosing stretches: a rival further behind at its place is not put in the effect's place."""
MOST_RIVALS = 2
SUREST = 0.98
"""What no finding exceeds: physics that the vocabulary lacks can look like any of it."""
CLOSED = ((0.9, 1.0), (0.75, 0.85), (0.5, 0.45))
"""Share of what was beyond noise at its place that an effect took away, and the factor on its confidence; LEAST below the last.
True effects close 97 % and more on a stand, 90 % on the ground; what the vocabulary lacks, its nearest name closes in part."""
LEAST = 0.2


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


def contest(search: Search, chosen: Chosen, report: Report) -> list[Standing]:
    """The standing of each effect that stays."""
    fit = chosen.fit
    temper = TEMPER * max(1.0, fit.cost["choose"] / max(1, _samples(search, fit)))
    out = []
    for i, c in enumerate(fit.effects):
        report(f"rivals of {c}", i / len(fit.effects))
        rivals = [_put(search, fit, i, t) for t in _near(chosen.rounds, c)]
        cost = np.array([fit.cost["choose"], *(r.cost["choose"] for r in rivals)])
        weight = np.exp(-0.5 * (cost - cost.min()) / temper)
        p = weight / weight.sum()
        sure = SUREST * _completeness(search, chosen, c)
        told = [Rival(r.effects[-1], r.x[r.slices()[-1]], float(r.cost["choose"] - fit.cost["choose"]), float(q) * sure, r)
                for r, q in zip(rivals, p[1:])]
        out.append(Standing(float(p[0]) * sure, tuple(sorted(told, key=lambda r: -r.probability))))
    return out


def round_of(rounds: Sequence[Round], c: Candidate) -> tuple[Round, Trial] | None:
    """When a candidate was taken."""
    for r in reversed(rounds):
        for t in r.accepted:
            if t.candidate.key == c.key:
                return r, t
    return None


def _near(rounds: Sequence[Round], c: Candidate) -> list[Trial]:
    found = round_of(rounds, c)
    if found is None:
        return []
    r, trial = found
    taken = {t.candidate.key for t in r.accepted}
    near = [t for t in r.rivals(trial) if not t.foretold and t.candidate.key not in taken
            and trial.gain["choose"] - t.gain["choose"] < max(NEAR, 0.05 * trial.gain["choose"])]
    return near[:MOST_RIVALS]


def _put(search: Search, fit: Fit, i: int, rival: Trial) -> Fit:
    """The fit with a rival in effect i's place, its numbers and those of the others fitted anew."""
    others = [s for j, s in enumerate(fit.sizes()) if j != i]
    there = search.evaluated([*others, (rival.candidate, rival.x)])
    if there.cost["choose"] - fit.cost["choose"] > 2 * NEAR:
        return there
    return search.refitted(there, search.fitted, 1, free=[len(others)])


def _samples(search: Search, fit: Fit) -> int:
    return int(np.count_nonzero(search.jury.vector(fit.residuals, "choose")))


def _completeness(search: Search, chosen: Chosen, c: Candidate) -> float:
    """Factor for how much of what was at its place is explained: when it was taken, or by all effects together."""
    found = round_of(chosen.rounds, c)
    if found is None:
        return LEAST
    closed = completed(search, *found, chosen.fit)
    return next((factor for share, factor in CLOSED if closed >= share), LEAST)
