"""Sets of effects of one joint that are fitted together, with one of them replaced, by linear prediction around their fit.

Responses around a robot without effects predict poorly how an effect acts in combination with two more. Around a fit the
extrapolation is short, and the others can adapt: sequential replacement (A. J. Miller, Subset Selection in Regression, 2002).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.optimize import lsq_linear

from workbench.identify.fitting.fit import Fit, Sizes
from workbench.identify.fitting.fits import Search
from workbench.identify.fitting.levenberg_marquardt import steps_of
from workbench.identify.fitting.responses import scan
from workbench.identify.options import FIT
from workbench.identify.parameters import Candidate, with_effects
from workbench.identify.rollouts.evaluator import RolloutRequest
from workbench.identify.selection.best_subsets import (
    Response,
    fitted_beside,
    penalised_cost,
    possible,
    restart_fit,
    several,
    variants,
    worst_joint,
)
from workbench.identify.selection.options import SUBSETS
from workbench.identify.selection.record import CandidateFit
from workbench.types import Array

NOTHING = {"fit": 0.0, "choose": 0.0}
"""The gain of what lines only predict."""


def sets_at_worst_joint(search: Search, current: Fit, trials: Sequence[CandidateFit], takes: tuple[int, ...],
                        beyond: dict[str, float]) -> list[tuple[Fit, list[CandidateFit]]]:
    """Sets of effects for the joint that errs most, fitted beside `current`, the best first, and sets with one effect of the best
    replaced, until none of these is better."""
    joint = worst_joint(beyond)
    sets = [] if joint is None else _fit_sets(search, current, several(search, current, trials, takes, joint), takes)
    if joint is None or not sets:
        return []
    for _ in range(SUBSETS.exchanges):
        fit, chosen = sets[0]
        if _is_right(search, fit, takes, joint):
            break
        if (again := restart_fit(search, fit, takes, SUBSETS.together_steps)) is not fit:
            sets[0] = again, chosen
            continue
        known = {frozenset(t.candidate.key for t in others) for _, others in sets}
        new = [s for s in exchanges(search, fit, trials, takes, joint, [t.candidate for t in chosen])
               if frozenset(t.candidate.key for t in s) not in known]
        sets = sorted([*sets, *_fit_sets(search, current, new, takes)], key=lambda f: penalised_cost(f[0]))
        if sets[0][0] is fit:
            break
    return sets


def _is_right(search: Search, fit: Fit, takes: tuple[int, ...], joint: str) -> bool:
    """Whether the residuals of a fit in a joint are about those of a correct model."""
    left, expected = search.evaluator.by_channel({i: fit.residuals[i] for i in takes}, "choose", joint)
    return bool(left.sum() < SUBSETS.right * expected.sum())


def _fit_sets(search: Search, current: Fit, sets: Sequence[list[CandidateFit]], takes: tuple[int, ...]
              ) -> list[tuple[Fit, list[CandidateFit]]]:
    """Sets of effects fitted beside `current`, the best first: all some way, those ahead by then to the end, from new slopes."""
    begun = search.side_by_side([fitted_beside(search, current, chosen, takes, SUBSETS.most_steps) for chosen in sets])
    ranked = sorted(zip(begun, sets), key=lambda f: penalised_cost(f[0]))
    ended = search.side_by_side([search.refitting(fit, takes, SUBSETS.together_steps) for fit, _ in ranked[:SUBSETS.ahead]])
    return sorted([*zip(ended, (chosen for _, chosen in ranked)), *ranked[SUBSETS.ahead:]], key=lambda f: penalised_cost(f[0]))


def exchanges(search: Search, fit: Fit, trials: Sequence[CandidateFit], takes: tuple[int, ...], joint: str,
              alone: Sequence[Candidate]) -> list[list[CandidateFit]]:
    """Sets in which another effect replaces one of `alone`, which `fit` has among others, with initial sizes. trials: all
    candidates that were tried for the joint, on these takes, whose base is fixed."""
    there = fit.sizes_by_key()
    mine = [c for c in alone if c.key in there]
    others = [t for t in trials if t.joint in (joint, None) and t.candidate.size and t.candidate.key not in there]
    if not mine or not others:
        return []
    moves = [there[c.key] + np.diag(steps_of(there[c.key], *c.bounds(), FIT.stride_fixed)) for c in mine]
    probes = [scan(t.candidate, FIT.scanned, walking=False) for t in others]
    asked: list[Sizes] = [fit.sizes_with(c.key, x) for c, points in zip(mine, moves) for x in points]
    asked += [fit.sizes_without(c.key) for c in mine]
    asked += [[*fit.sizes(), (t.candidate, p)] for t, points in zip(others, probes) for p in points]
    answers = search.evaluator.residuals([RolloutRequest(with_effects(search.nominal, sizes), takes) for sizes in asked])
    seen = iter([search.evaluator.vector(a, "fit", joint) for a in answers])
    left = search.evaluator.vector({i: fit.residuals[i] for i in takes}, "fit", joint)
    slopes = [np.column_stack([(next(seen) - left) / float((x - there[c.key]).sum()) for x in points])
              for c, points in zip(mine, moves)]
    rests = [next(seen) for _ in mine]
    responses = [[next(seen) - left for _ in points] for points in probes]
    out: list[list[CandidateFit]] = []
    for k, rest in enumerate(rests):
        staying = [n for n in range(len(mine)) if n != k]
        x = [there[mine[n].key] for n in staying]
        sets = [s for t, points, did in zip(others, probes, responses)
                for s in in_place(t, points, did, rest, [mine[n] for n in staying], x, [slopes[n] for n in staying])]
        sets.sort(key=lambda s: s[0])
        out += [chosen for cost, chosen in sets[:SUBSETS.exchanged] if cost < SUBSETS.as_good * sets[0][0]]
    return out


def in_place(t: CandidateFit, points: Sequence[Array], did: Sequence[Array], rest: Array, staying: Sequence[Candidate],
             x: Sequence[Array], slopes: Sequence[Array]) -> list[tuple[float, list[CandidateFit]]]:
    """Residuals with one effect replaced by another, and the set with its sizes: for one parameter, the best of those that were
    simulated; for several, all at once. rest: residuals without the replaced effect."""
    ends = np.cumsum([0, *(len(size) for size in x)])
    ways: list[tuple[float, list[CandidateFit]]] = []
    for seen in variants(t, points, did):
        solved = lsq_linear(np.column_stack([*slopes, seen.responses]), -rest, _bounds(seen, staying, x))
        size = seen.sizes(solved.x[ends[-1]:])
        if possible(seen, size):
            beside = [
                CandidateFit(e, start + solved.x[a:b], NOTHING, t.joint) for e, start, (a, b) in zip(staying, x, pairwise(ends))
            ]
            ways.append((2.0 * float(solved.cost), [*beside, replace(t, x=size, screened_out=False)]))
    return sorted(ways, key=lambda way: way[0])[:1]


def _bounds(seen: Response, staying: Sequence[Candidate], x: Sequence[Array]) -> tuple[Array, Array]:
    """Bounds on moves of the effects that stay, and on shares of the points at which the other was seen."""
    low = [e.bounds()[0] - size for e, size in zip(staying, x)]
    high = [e.bounds()[1] - size for e, size in zip(staying, x)]
    if len(seen.points) == 1:
        own = ~seen.trial.candidate.shapes
        ends = np.sort(np.array(seen.trial.candidate.bounds())[:, own][:, 0] / seen.points[0][own][0])
        return np.concatenate([*low, ends[:1]]), np.concatenate([*high, ends[1:]])
    free = np.full(len(seen.points), np.inf)
    return np.concatenate([*low, -free]), np.concatenate([*high, free])
