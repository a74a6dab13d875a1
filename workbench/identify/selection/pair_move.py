"""Pair moves, for confounded causes: a force that lifts the robot explains much of the joint response of a slope and a slippery
floor.

The single effect that explains most is found first, and then nothing completes it. Therefore that effect and its closest rivals
are tried in pairs, predicted linearly around each one's own fit, in which all effects identified on floating-base takes may
adapt: a saturating motor compensates for much of a leaning body.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.identify.fitting.fit import Fit, Sizes
from workbench.identify.fitting.fits import Search
from workbench.identify.fitting.levenberg_marquardt import steps_of
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


@dataclass(frozen=True)
class _Around:
    """Questions around a fit with one effect: each parameter that floating-base takes identify is perturbed, and each other
    effect is added."""

    one: CandidateFit
    fit: Fit
    moves: list[tuple[Candidate, Array, Array]]
    probes: list[tuple[Candidate, list[Array]]]

    @classmethod
    def of(cls, one: CandidateFit, fit: Fit, others: Sequence[Candidate], search: Search) -> _Around:
        c = one.candidate
        company = [o for o in others if o.key != c.key and not (o.effect.steady_pull and c.effect.steady_pull)]
        moves = [(e, x, steps_of(x, *e.bounds(), FIT.stride_free, e.magnitudes(x))) for e, x in fit.sizes()
                 if e.size and not search.is_settled(e)]
        return cls(one, fit, moves, [(o, _probes(o)) for o in company])

    def sizes_around(self) -> Iterator[Sizes]:
        yield self.fit.sizes()
        for e, x, move in self.moves:
            yield from (self.fit.sizes_with(e.key, moved) for moved in x + np.diag(move))
        for c, points in self.probes:
            yield from ([*self.fit.sizes(), (c, p)] for p in points)

    def predictions(self, left: Array, answers: Iterator[Array]) -> Iterator[tuple[float, list[CandidateFit]]]:
        """Predicted residual of each pair, and its sizes. left: residuals of this fit; answers: those of every question."""
        plain = next(answers)
        slopes = [np.column_stack([(next(answers) - plain) / size for size in move]) for _, _, move in self.moves]
        moving, x = [e for e, _, _ in self.moves], [x for _, x, _ in self.moves]
        for c, points in self.probes:
            did = [next(answers) - plain for _ in points]
            for cost, chosen in in_place(CandidateFit(c, points[0], NOTHING, None), points, did, left, moving, x, slopes):
                yield cost, [t for t in chosen if t.candidate.key in (self.one.candidate.key, c.key)]


def _probes(c: Candidate) -> list[Array]:
    """Sizes at which an effect is looked at: the floor's alone at two."""
    sizes = (FIT.scanned_around,) if c.size > 1 else FIT.scanned_ground[:1] if c.where else FIT.scanned_ground
    return [np.clip(s * p, *c.bounds()) for p in c.probes() for s in sizes]


def _predict_pairs(search: Search, rest: Fit, ones: Sequence[CandidateFit], others: Sequence[Candidate]
                   ) -> list[list[CandidateFit]]:
    """The pairs with the smallest residuals according to lines around each one's fit, with sizes to begin from."""
    takes = search.telling([t.candidate for t in ones], search.fitted)
    around = [_Around.of(t, search.evaluate([*rest.sizes(), (t.candidate, t.x)]), others, search) for t in ones]
    questions = [
        RolloutRequest(with_effects(search.nominal, sizes), takes, PROBLEM.coarse) for a in around for sizes in a.sizes_around()
    ]
    answers = iter([search.evaluator.vector(answer, "fit") for answer in search.evaluator.residuals(questions)])
    best: dict[frozenset[Key], tuple[float, list[CandidateFit]]] = {}
    for a in around:
        for cost, pair in a.predictions(search.evaluator.vector({i: a.fit.residuals[i] for i in takes}, "fit"), answers):
            name = frozenset(t.candidate.key for t in pair)
            best[name] = min(best.get(name, (np.inf, pair)), (cost, pair), key=lambda b: b[0])
    return [pair for _, pair in sorted(best.values(), key=lambda b: b[0])[:PAIR_MOVE.pairs]]


def _enough(search: Search, fit: Fit, pair: Sequence[CandidateFit], current: Fit, rounds: Sequence[SelectionStep]) -> bool:
    """Whether a pair brings as much more than the one as any effect has to."""
    takes = search.telling([t.candidate for t in pair], search.fitted)
    was, now = (search.evaluator.by_channel({i: f.residuals[i] for i in takes}, "choose")[0] for f in (current, fit))
    more = replace(pair[-1], gain={use: current.cost[use] - fit.cost[use] for use in NOTHING}, by_channel=was - now)
    return is_acceptable(search, more, search.fitted, rounds, current)
