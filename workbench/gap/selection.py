"""Forward and backward: which effects stay, judged on stretches that no fit saw."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.gap.candidates import Candidate
from workbench.gap.search import Fit, Search

Report = Callable[[str, float | None], None]
MOST_EFFECTS = 4
SHORTLIST = 5
LEAST_SHARE = 0.25
"""Of the best screening gain, below which a candidate is not simulated."""
LEAST_GAIN, LEAST_RELATIVE_GAIN = 60.0, 0.03
"""Of chi squared on the choosing stretches that an effect must bring: absolutely (a likelihood ratio of e^30, since neighbouring
frames share what the model lacks), and as a share of what was there."""
TEMPER = 4.0
"""Neighbouring frames err alike: chi squared differences count a quarter when they become probabilities."""


@dataclass(frozen=True)
class Round:
    """One step of the selection: rivals fitted beside what had been chosen, the best first."""

    before: Fit
    trials: tuple[Fit, ...]
    accepted: bool

    def added(self, fit: Fit) -> Candidate:
        """The effect that a trial adds."""
        return fit.effects[-1]

    def probabilities(self) -> list[float]:
        """Of the trials, given that one of them is the effect: likelihoods on the choosing stretches, tempered."""
        cost = np.array([f.cost["choose"] for f in self.trials])
        weight = np.exp(-0.5 * (cost - cost.min()) / TEMPER)
        return [float(w) for w in weight / weight.sum()]


def select(search: Search, report: Report) -> tuple[Fit, list[Round]]:
    """The effects that stay, fitted together, and how they were found."""
    current = search.fit([], np.empty(0))
    rounds: list[Round] = []
    while len(current.effects) < MOST_EFFECTS:
        chosen = {(c.effect.name, c.where) for c in current.effects}
        ranked = [row for row in search.rank(current.residuals) if (row[1].effect.name, row[1].where) not in chosen]
        shortlist = [row for row in ranked[:SHORTLIST] if row[0] > max(LEAST_GAIN / 2, LEAST_SHARE * ranked[0][0])]
        trials = []
        for n, (_, candidate, size) in enumerate(shortlist):
            report(f"fitting {candidate} ({len(rounds) + 1})", n / len(shortlist))
            trials.append(add(search, current, candidate, size))
        trials.sort(key=lambda f: f.cost["choose"])
        accepted = bool(trials) and worthwhile(current, trials[0])
        rounds.append(Round(current, tuple(trials), accepted))
        if not accepted:
            break
        current = trials[0]
        if len(current.effects) > 1:
            report("fitting together", None)
            joint = search.fit(current.effects, current.x, iterations=2)
            current = joint if joint.cost["fit"] < current.cost["fit"] else current
    return without_idle(search, current), rounds


def add(search: Search, current: Fit, candidate: Candidate, size: Sequence[float] | np.ndarray) -> Fit:
    """`current` and one effect more, whose numbers alone are fitted."""
    x = np.concatenate([current.x, np.asarray(size, dtype=float)])
    free = np.arange(len(current.x), len(x))
    return search.fit([*current.effects, candidate], x, iterations=3, takes=search.telling(candidate), free=free)


def worthwhile(before: Fit, after: Fit) -> bool:
    """Whether an effect lowers chi squared on the choosing stretches by more than chance and shared errors allow."""
    gain = before.cost["choose"] - after.cost["choose"]
    return gain > LEAST_GAIN * max(1, len(after.x) - len(before.x)) and gain > LEAST_RELATIVE_GAIN * before.cost["choose"]


def without_idle(search: Search, current: Fit) -> Fit:
    """Backward: an effect that the others have made idle goes."""
    for i in range(len(current.effects) - 1, -1, -1):
        if len(current.effects) < 2:
            break
        keep = [j for j in range(len(current.effects)) if j != i]
        x = np.concatenate([current.x[current.slices()[j]] for j in keep])
        rest = search.fit([current.effects[j] for j in keep], x, iterations=1)
        if not worthwhile(rest, current):
            current = rest
    return current
