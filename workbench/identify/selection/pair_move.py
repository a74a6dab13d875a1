"""Pair moves, for confounded causes: a force that lifts the robot explains much of the joint response of a slope and a slippery
floor.

The single effect that explains most is found first, and then nothing completes it. Therefore that effect and its closest rivals
are tried in pairs, predicted linearly around each one's own fit, in which all effects identified on floating-base takes may
adapt: a saturating motor compensates for much of a leaning body.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from workbench.identify.fitting.fit import Fit, Sizes
from workbench.identify.fitting.fits import Search
from workbench.identify.fitting.levenberg_marquardt import steps_of
from workbench.identify.fitting.responses import Part
from workbench.identify.options import FIT, PROBLEM
from workbench.identify.parameters import Candidate, Key, with_effects
from workbench.identify.rollouts.evaluator import RolloutRequest
from workbench.identify.selection.acceptance import is_acceptable, too_little_left
from workbench.identify.selection.best_subsets import fitted_beside, penalised_cost, selection_steps
from workbench.identify.selection.options import PAIR_MOVE, RECONSIDER
from workbench.identify.selection.record import CandidateFit, SelectionStep, judged_by_all
from workbench.identify.selection.swap import NOTHING, in_place
from workbench.types import Array, Progress


def with_pair(search: Search, pool: Sequence[Candidate], current: Fit, rounds: Sequence[SelectionStep], report: Progress
           ) -> tuple[Fit, list[SelectionStep]]:
    """The fit, with two effects in the place of the last that floating-base takes identified, one of them at least of the ground
    or of masses, where that left much and these bring enough more, and the rounds with them."""
    there = current.sizes_by_key()
    by_all = [(r, t) for r in rounds for t in r.accepted if judged_by_all(search, t) and t.candidate.key in there]
    if not by_all or by_all[-1][1].closed > RECONSIDER.complete or by_all[-1][1].candidate.effect.point_mass:
        return current, list(rounds)
    if too_little_left(search, current, search.fitted, rounds):
        return current, list(rounds)
    first, found = by_all[-1]
    report(f"trying two causes for {found.candidate}", None)
    rest = search.evaluate(current.sizes_without(found.candidate.key))
    free = [c for c in pool if _may_pair(c) and c.key not in {e.key for e in rest.effects}]
    known = {found.candidate.key: replace(found, x=there[found.candidate.key])}
    known |= {t.candidate.key: t for t in first.trials if t.candidate in free and judged_by_all(search, t)
              and t.candidate.key != found.candidate.key and t.gain["choose"] >= PAIR_MOVE.near * found.gain["choose"]}
    pairs = _predict_pairs(search, rest, list(known.values())[:PAIR_MOVE.ones], free)
    fits = search.side_by_side([fitted_beside(search, rest, pair, search.fitted, PAIR_MOVE.steps) for pair in pairs])
    ranked = sorted(zip(fits, pairs), key=lambda f: penalised_cost(f[0]))
    if not ranked or not _enough(search, *ranked[0], current, rounds):
        return current, list(rounds)
    instead = [_with_first_trials(r, first) for r in selection_steps(search, rest, ranked)]
    return ranked[0][0], [*(r for r in rounds if r is not first), *instead]


def _with_first_trials(taken: SelectionStep, first: SelectionStep) -> SelectionStep:
    """A round with the other first candidates: the equivalent effect of a pull has to be tried as its replacement."""
    fitted = {t.candidate.key for t in taken.trials}
    return replace(taken, trials=(*taken.trials, *(t for t in first.trials if t.candidate.key not in fitted)))


def _may_pair(c: Candidate) -> bool:
    """Effects of the ground, and positions of masses; not the mass of a load, which floating-base takes identify last."""
    return c.size > 0 and c.effect.layer in ("ground", "inertia") and not c.effect.point_mass


def _predict_pairs(search: Search, rest: Fit, ones: Sequence[CandidateFit], others: Sequence[Candidate]
                   ) -> list[list[CandidateFit]]:
    """The pairs with the smallest residuals according to lines around each one's fit, with sizes to begin from."""
    takes = search.telling([t.candidate for t in ones], search.fitted)
    around = [(t.candidate, search.evaluate([*rest.sizes(), (t.candidate, t.x)])) for t in ones]
    best: dict[frozenset[Key], tuple[float, list[CandidateFit]]] = {}
    for predicted in search.side_by_side([_pairs_with(search, c, fit, others, takes) for c, fit in around]):
        for cost, pair in predicted:
            name = frozenset(t.candidate.key for t in pair)
            best[name] = min(best.get(name, (np.inf, pair)), (cost, pair), key=lambda b: b[0])
    return [pair for _, pair in sorted(best.values(), key=lambda b: b[0])[:PAIR_MOVE.pairs]]


def _pairs_with(search: Search, one: Candidate, fit: Fit, others: Sequence[Candidate], takes: tuple[int, ...]
                ) -> Part[list[tuple[float, list[CandidateFit]]]]:
    """The predicted residual of each pair with an effect, and its sizes, from coarse rollouts around a fit with that effect: each
    parameter that floating-base takes identify is moved, and each other effect is added."""
    moves = [(e, x, steps_of(x, *e.bounds(), FIT.stride_free, e.magnitudes(x))) for e, x in fit.sizes()
             if e.size and not search.is_settled(e)]
    probes = [(c, _probes(c)) for c in others if c.key != one.key and not (c.effect.steady_pull and one.effect.steady_pull)]
    asked: list[Sizes] = [fit.sizes()]
    asked += [fit.sizes_with(e.key, moved) for e, x, move in moves for moved in x + np.diag(move)]
    asked += [[*fit.sizes(), (c, p)] for c, points in probes for p in points]
    answers = yield [RolloutRequest(with_effects(search.nominal, sizes), takes, PROBLEM.coarse) for sizes in asked]
    plain, *seen = (search.evaluator.vector(answer, "fit") for answer in answers)
    did = iter([r - plain for r in seen])
    slopes = [np.column_stack([next(did) / size for size in move]) for _, _, move in moves]
    left = search.evaluator.vector({i: fit.residuals[i] for i in takes}, "fit")
    moving, x = [e for e, _, _ in moves], [x for _, x, _ in moves]
    out: list[tuple[float, list[CandidateFit]]] = []
    for c, points in probes:
        added = CandidateFit(c, points[0], NOTHING, None)
        for cost, chosen in in_place(added, points, [next(did) for _ in points], left, moving, x, slopes):
            out.append((cost, [t for t in chosen if t.candidate.key in (one.key, c.key)]))
    return out


def _probes(c: Candidate) -> list[Array]:
    """Sizes at which an effect is looked at: the floor's alone at two."""
    sizes = (FIT.scanned_around,) if c.size > 1 else FIT.scanned_ground[:1] if c.where else FIT.scanned_ground
    return [np.clip(s * p, *c.bounds()) for p in c.probes() for s in sizes]


def _enough(search: Search, fit: Fit, pair: Sequence[CandidateFit], current: Fit, rounds: Sequence[SelectionStep]) -> bool:
    """Whether a pair brings as much more than the one as any effect has to."""
    takes = search.telling([t.candidate for t in pair], search.fitted)
    was, now = (search.evaluator.by_channel({i: f.residuals[i] for i in takes}, "choose")[0] for f in (current, fit))
    more = replace(pair[-1], gain={use: current.cost[use] - fit.cost[use] for use in NOTHING}, by_channel=was - now)
    return is_acceptable(search, more, search.fitted, rounds, current)
