"""Several effects in one joint at once: the prediction of their combined responses, where no single effect explains the
residuals.

Linear interpolation between the responses of single effects is cheap, so that all sets are tried: best subsets, not one at a time
(A. J. Miller, Subset Selection in Regression, 2002). Only the best sets are fitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from workbench.compare.channels import BODY, joint_of
from workbench.identify.fitting.fit import Fit, Sizes
from workbench.identify.fitting.fits import Search
from workbench.identify.fitting.responses import Part
from workbench.identify.options import FIT
from workbench.identify.selection.options import SUBSETS
from workbench.identify.selection.record import CandidateFit, SelectionStep
from workbench.types import Array, Mask


@dataclass(frozen=True)
class Response:
    """Change of a joint's residuals caused by an effect: responses (m, k), each at the sizes in a row of points (k, n)."""

    trial: CandidateFit
    responses: Array
    points: Array

    def sizes(self, share: Array) -> Array:
        """Sizes at these shares (k,) of the points, as far as bounds allow."""
        low, high = self._bounds
        return np.minimum(np.maximum(np.where(self.shapes, self.points[0], share @ self.points), low), high)

    def shares(self, x: Array) -> Array:
        """The shares of the points that make these sizes."""
        return self._inverse @ x[~self.shapes]

    @cached_property
    def shapes(self) -> Mask:
        """Which sizes only shape the effect. Kept, as every set asks for it and for the bounds."""
        return self.trial.candidate.shapes

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        return self.trial.candidate.bounds()

    @cached_property
    def _inverse(self) -> Array:
        return np.asarray(np.linalg.pinv(self.points[:, ~self.shapes].T), dtype=float)


def several(search: Search, current: Fit, trials: Sequence[CandidateFit], takes: tuple[int, ...], joint: str
            ) -> list[list[CandidateFit]]:
    """Sets of effects that, as responses predict it, explain a joint far better than fewer do, with sizes to begin from, where
    the base is fixed and no single effect is most of its gap. trials: of a screening beside `current` on these takes."""
    alone = max((t.closed for t in trials if t.joint in (joint, None)), default=0.0)
    if search.evaluator.any_floating(takes) or alone > SUBSETS.nearly_all:
        return []
    known = [(t, looked) for t in trials if t.joint in (joint, None) and (looked := _signatures(search, t, takes)) is not None]
    base = {i: current.residuals[i] for i in takes}
    rows = {j: _rows(search, current, takes, j, joint) for j in {t.joint for t, _ in known} | {joint}}
    r0 = search.evaluator.vector(base, "fit", joint)[rows[joint]]
    seen = [s for t, (points, did) in known for s in variants(t, points, [v[rows[t.joint]] for v in did])]
    return best_sets(seen, r0) if seen else []


def _signatures(search: Search, t: CandidateFit, takes: tuple[int, ...]) -> tuple[list[Array], list[Array]] | None:
    """Sizes at which a candidate was simulated, and the response to each."""
    for name, (points, seen) in search.responses.items():
        if name[-1] == takes and t.candidate.key in name[:-1]:
            b = name.index(t.candidate.key)
            return points, [s[b] for s in seen]
    return None


def _rows(search: Search, current: Fit, takes: tuple[int, ...], judged: str | None, joint: str) -> Mask:
    """The entries of the vector of the channels of `judged` (None: of every channel) that belong to a joint."""
    inside = {}
    for i in takes:
        e = search.evaluator.evidence[i]
        inside[i] = np.zeros_like(current.residuals[i])
        inside[i][:, e.columns(joint)] = 1.0
    return search.evaluator.vector(inside, "fit", judged) != 0


def variants(t: CandidateFit, points: Sequence[Array], responses: Sequence[Array]) -> Iterator[Response]:
    """An effect of several numbers, each seen alone; of one, as it was seen at each size."""
    c = t.candidate
    if not c.size or not len(points):
        return
    if np.count_nonzero(~c.shapes) > 1:
        yield Response(t, np.stack(responses, axis=1), np.array(points))
        return
    for p, v in zip(points, responses):
        yield Response(t, v[:, None], p[None])


def best_sets(seen: Sequence[Response], r0: Array) -> list[list[CandidateFit]]:
    """The best sets of each size by the predicted linear remainder of the residuals `r0`, the best first."""
    lines = _NormalEquations(seen, r0)
    best = lines.whole
    out: list[list[CandidateFit]] = []
    for size in (1, *SUBSETS.sizes):
        sets: dict[frozenset[object], tuple[float, list[CandidateFit]]] = {}
        for which in combinations(range(len(seen)), size):
            name = frozenset(seen[k].trial.candidate.key for k in which)
            if len(name) < size:
                continue
            left, x = lines.lowest(which)
            if (name not in sets or left < sets[name][0]) and all(possible(seen[k], there) for k, there in zip(which, x)):
                sets[name] = left, [replace(seen[k].trial, x=there, screened_out=False) for k, there in zip(which, x)]
        ranked = sorted(sets.values(), key=lambda s: s[0])
        if not ranked or (size == 1 and ranked[0][0] < (1 - SUBSETS.nearly_all) * best):
            break
        if size > 1 and ranked[0][0] < SUBSETS.half * best:
            out += [trials for left, trials in ranked[:SUBSETS.fitted] if left < SUBSETS.as_good * ranked[0][0]]
        best = min(best, ranked[0][0])
    return out


class _NormalEquations:
    """The residuals r0 less a linear combination of the responses."""

    def __init__(self, seen: Sequence[Response], r0: Array) -> None:
        A = np.concatenate([s.responses for s in seen], axis=1)
        self.seen, self.whole = seen, float(r0 @ r0)
        self.ends = np.cumsum([0, *(s.responses.shape[1] for s in seen)])
        self.H, self.g = A.T @ A, A.T @ r0
        self.H[np.diag_indices_from(self.H)] += 1e-9 * np.diag(self.H) + 1e-9

    def lowest(self, which: Sequence[int]) -> tuple[float, list[Array]]:
        """The least that some of them leave of the sum of squares, as far as they may go, and at which sizes."""
        numbers = [np.arange(self.ends[k], self.ends[k + 1]) for k in which]
        n = np.concatenate(numbers)
        H, g = self.H[np.ix_(n, n)], self.g[n]
        parts = np.split(-np.linalg.solve(H, g), np.cumsum([len(own) for own in numbers])[:-1])
        x = [self.seen[k].sizes(part) for k, part in zip(which, parts)]
        share = np.concatenate([self.seen[k].shares(there) for k, there in zip(which, x)])
        return self.whole + float(2 * g @ share + share @ H @ share), x


def possible(s: Response, x: Array) -> bool:
    """Whether an effect is there at all, at these sizes."""
    return bool(np.abs(x[~s.shapes]).max(initial=0.0) > 0)


def worst_joint(beyond: dict[str, float]) -> str | None:
    """The joint that errs most; None where none does."""
    worst = max((c for c in beyond if c not in BODY), key=lambda c: beyond[c], default=None)
    return None if worst is None else joint_of(worst)


def fitted_beside(search: Search, current: Fit, added: Sequence[CandidateFit], takes: tuple[int, ...], steps: int) -> Part[Fit]:
    """Fits all effects together, after some were added."""
    return (yield from _fitted_from(search, [*current.sizes(), *((t.candidate, t.x) for t in added)], takes, steps))


def _fitted_from(search: Search, sizes: Sizes, takes: tuple[int, ...], steps: int) -> Part[Fit]:
    (start,) = yield from search.evaluating(sizes)
    return (yield from search.refitting(start, takes, steps))


def restart_fit(search: Search, fit: Fit, takes: tuple[int, ...], steps: int) -> Fit:
    """A fit, or a far better one from another starting point: parameters that shape an effect make its response nonlinear, and a
    fit may end in a local minimum. steps: of the last fit."""
    starts = [fit.sizes_with(c.key, np.clip(np.where(c.shapes, x + doublings, x * share), *c.bounds()))
              for c, x in fit.sizes() if c.shapes.any() for share, doublings in SUBSETS.again]
    if not starts:
        return fit
    fits = search.side_by_side([_fitted_from(search, sizes, takes, SUBSETS.most_steps) for sizes in starts])
    best = min(fits, key=penalised_cost)
    return search.refit(best, takes, steps) if penalised_cost(best) < SUBSETS.half * penalised_cost(fit) else fit


def penalised_cost(fit: Fit) -> float:
    """Residual cost of a fit on the choosing stretches, with the gain required for its parameters."""
    return fit.cost["choose"] + FIT.least_gain * len(fit.x)


def selection_steps(search: Search, current: Fit, sets: Sequence[tuple[Fit, list[CandidateFit]]]) -> list[SelectionStep]:
    """A round for each of the effects that are taken together, the first of `sets`, which were fitted; its rivals those with
    which another set has it replaced."""
    best, chosen = sets[0]
    names = {t.candidate.key for t in chosen}
    sizes = best.sizes_by_key()
    out = []
    for t in chosen:
        rest = search.evaluate(best.sizes_without(t.candidate.key))
        gain = {use: rest.cost[use] - best.cost[use] for use in ("fit", "choose")}
        trials = [replace(t, x=sizes[t.candidate.key], gain=gain)]
        for fit, others in sets[1:]:
            new = [o for o in others if o.candidate.key not in names]
            if len(others) == len(chosen) and len(new) == 1 and t.candidate.key not in {o.candidate.key for o in others}:
                theirs = {use: gain[use] - fit.cost[use] + best.cost[use] for use in gain}
                trials.append(replace(new[0], x=fit.sizes_by_key()[new[0].candidate.key], gain=theirs, joint=t.joint))
        out.append(SelectionStep(current, tuple(trials), (trials[0],)))
    return out
