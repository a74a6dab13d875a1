"""Sets of effects that are fitted together, where no single one is most of what a joint lacks."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import Candidate
from workbench.identify.selection.best_subsets import (
    begun_again,
    fitted_beside,
    penalised_cost,
    selection_steps,
    several,
    worst_joint,
)
from workbench.identify.selection.candidate_fit import CandidateFit
from workbench.identify.selection.options import REEVALUATION, SCHEDULING, SINGLE_JOINT, SUBSETS
from workbench.identify.selection.record import SelectionStep
from workbench.identify.selection.scheduling import asked
from workbench.identify.selection.screening import tried
from workbench.identify.selection.swap import NOTHING, exchanges

Array = NDArray[np.float64]


def single_joint_step(search: Search, pool: Sequence[Candidate], current: Fit, beyond: dict[str, float], takes: tuple[int, ...],
               say: Callable[[float], None]) -> tuple[Fit, list[SelectionStep]]:
    """Of a robot of one joint, in which all acts: sets of effects before any is fitted alone, if one is nearly all."""
    looked = _looked_at(search, pool, current, beyond, takes, say)
    sets = together(search, current, looked, takes, beyond)
    if not sets:
        return current, []
    best = sets[0][0]
    before, after = ({i: fit.residuals[i] for i in takes} for fit in (current, best))
    if search.evaluator.closed(before, after, "choose") <= SUBSETS.nearly_all:
        return current, []
    return best, selection_steps(search, current, sets)


def set_right(search: Search, pool: Sequence[Candidate], current: Fit, rounds: Sequence[SelectionStep], takes: tuple[int, ...],
              say: Callable[[float], None]) -> tuple[Fit, list[SelectionStep]]:
    """Of a robot of one joint: a set that leaves about what a right model does, where what was found so far leaves more: with one
    effect replaced, one more, or one sharing its work with a rival. A weaker supply does nearly all that friction does, and no
    fit that begins with the one comes to both."""
    (joint,) = search.nominal.joints
    if not len(current.x) or _is_right(search, current, takes, joint):
        return current, []
    looked = _looked_at(search, pool, current, {joint: 1.0}, takes, say)
    nominal = search.evaluated([])
    other = exchanges(search, current, looked, takes, joint, current.effects, beside=True)
    shared = _shared(current, rounds, joint)
    sets = sorted([*_fitted(search, nominal, other, takes), *_fitted(search, nominal, shared, takes, len(shared))],
                  key=lambda f: penalised_cost(f[0]))
    if not sets or not (_is_right(search, sets[0][0], takes, joint) or _ends(search, current, sets[0][0], takes, joint)):
        return current, []
    return sets[0][0], selection_steps(search, nominal, sets)


def _shared(current: Fit, rounds: Sequence[SelectionStep], joint: str) -> list[list[CandidateFit]]:
    """Sets in which an effect and a rival that was nearly as good each have half the size that they had alone."""
    there = current.sizes_by_key()
    out = []
    for t, rivals in ((t, r.rivals(t)) for r in rounds for t in r.accepted if t.candidate.key in there):
        near = [o for o in rivals if o.candidate.key not in there and o.gain["choose"] > REEVALUATION.near * t.gain["choose"]]
        for o in near[:REEVALUATION.most]:
            halves = (t.candidate.key, o.candidate.key)
            sizes = [(c, np.where(c.shapes, x, x / 2) if c.key in halves else x)
                     for c, x in [*((c, _free(c, x)) for c, x in current.sizes()), (o.candidate, o.x)]]
            out.append([CandidateFit(c, x, NOTHING, joint) for c, x in sizes])
    return out


def _free(c: Candidate, x: Array) -> Array:
    """Sizes whose numbers that shape an effect are in the middle where they came to an end, from which no slope leads."""
    low, high = c.bounds()
    return np.where(c.shapes & ((x <= low) | (x >= high)), 0.0, x)


def _looked_at(search: Search, pool: Sequence[Candidate], current: Fit, beyond: dict[str, float], takes: tuple[int, ...],
               say: Callable[[float], None]) -> list[CandidateFit]:
    """What responses say of all that acts in the one joint, nothing fitted."""
    groups: list[list[Candidate]] = []
    on: dict[int, tuple[int, ...]] = {}
    for tier in range(SCHEDULING.single_joint_tier + 1):
        more, takes_of = asked(search, pool, current, beyond, takes, tier)
        on |= {len(groups) + n: takes_of[n] for n in range(len(more))}
        groups += more
    return tried(search, current, groups, on, say, least=np.inf)


def together(search: Search, current: Fit, trials: Sequence[CandidateFit], takes: tuple[int, ...], beyond: dict[str, float]
             ) -> list[tuple[Fit, list[CandidateFit]]]:
    """Sets of effects for the joint that errs most, fitted beside `current`, the best first, and sets with one effect of the best
    replaced, until none of these is better."""
    joint = worst_joint(beyond)
    sets = _fitted(search, current, several(search, current, trials, takes, beyond), takes)
    if joint is None or not sets:
        return []
    for _ in range(SINGLE_JOINT.exchanges):
        fit, chosen = sets[0]
        if _is_right(search, fit, takes, joint):
            break
        if (again := begun_again(search, fit, takes, SUBSETS.together_steps)) is not fit:
            sets[0] = again, chosen
            continue
        known = {frozenset(t.candidate.key for t in others) for _, others in sets}
        new = [s for s in exchanges(search, fit, trials, takes, joint, [t.candidate for t in chosen])
               if frozenset(t.candidate.key for t in s) not in known]
        sets = sorted([*sets, *_fitted(search, current, new, takes)], key=lambda f: penalised_cost(f[0]))
        if sets[0][0] is fit:
            break
    return sets


def _is_right(search: Search, fit: Fit, takes: tuple[int, ...], joint: str) -> bool:
    """Whether a fit leaves in a joint about what a right model does."""
    left, expected = search.evaluator.by_channel({i: fit.residuals[i] for i in takes}, "choose", joint)
    return bool(left.sum() < SINGLE_JOINT.right * expected.sum())


def _ends(search: Search, before: Fit, after: Fit, takes: tuple[int, ...], joint: str) -> bool:
    """Whether nearly all that a fit leaves in a joint beyond noise is gone in another."""
    both = ({i: fit.residuals[i] for i in takes} for fit in (before, after))
    (was, expected), (left, _) = (search.evaluator.by_channel(residuals, "choose", joint) for residuals in both)
    return bool(left.sum() - expected.sum() < (1 - SINGLE_JOINT.all_the_rest) * (was.sum() - expected.sum()))


def _fitted(search: Search, current: Fit, sets: Sequence[list[CandidateFit]], takes: tuple[int, ...],
            ahead: int = SINGLE_JOINT.ahead) -> list[tuple[Fit, list[CandidateFit]]]:
    """Sets of effects fitted beside `current`, the best first: all some way, those ahead by then to the end, from new slopes."""
    begun = search.side_by_side([fitted_beside(search, current, chosen, takes, SUBSETS.most_steps) for chosen in sets])
    ranked = sorted(zip(begun, sets), key=lambda f: penalised_cost(f[0]))
    ended = search.side_by_side([search.refitting(fit, takes, SUBSETS.together_steps) for fit, _ in ranked[:ahead]])
    return sorted([*zip(ended, (chosen for _, chosen in ranked)), *ranked[ahead:]], key=lambda f: penalised_cost(f[0]))
