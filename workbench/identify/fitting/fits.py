"""Fits of effects by rollouts: one effect at many joints at once, one at the whole robot, several together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.compare.metrics import rms
from workbench.identify.fitting.covariance import covariance_of
from workbench.identify.fitting.fit import Fit, Slopes
from workbench.identify.fitting.levenberg_marquardt import fit_blocks, lowest
from workbench.identify.fitting.lockstep import through, together
from workbench.identify.fitting.responses import Part, ResponseBank
from workbench.identify.options import FIT, PROBLEM
from workbench.identify.parameters import Candidate, with_effects
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.robot import RobotModel
from workbench.types import Array

T = TypeVar("T")


class Search:
    """Fits of effects to one session.

    settled: effects identified from fixed-base takes. They keep the values that these takes give them in all fits that follow,
    because contact biases what floating-base takes say of them. responses: responses scanned so far, a memory that all searches
    of a session share.
    """

    def __init__(
        self, evaluator: RolloutEvaluator, nominal: RobotModel, settled: Fit | None = None, responses: ResponseBank | None = None
    ) -> None:
        self.evaluator, self.nominal, self.settled = evaluator, nominal, settled
        self.responses: ResponseBank = {} if responses is None else responses
        self.takes = tuple(range(len(evaluator.evidence)))
        self.fitted = tuple(i for i, e in enumerate(evaluator.evidence) if e.uses["fit"].any() or e.uses["choose"].any())
        self.fixed_base = tuple(i for i in self.fitted if not evaluator.any_floating((i,)))

    def on(self, evaluator: RolloutEvaluator) -> Search:
        """The same search on other takes of the session."""
        return Search(evaluator, self.nominal, self.settled, self.responses)

    def with_settled(self, settled: Fit | None) -> Search:
        """The same search with other effects settled."""
        return Search(self.evaluator, self.nominal, settled, self.responses)

    def is_settled(self, c: Candidate) -> bool:
        """Whether fixed-base takes identified its numbers."""
        return self.settled is not None and c.key in {e.key for e in self.settled.effects}

    def identified_on_fixed_base(self, c: Candidate) -> bool:
        """Whether all takes have a fixed base, or fixed-base takes identify this candidate."""
        return self.is_settled(c) or self.fixed_base == self.fitted

    def floating_base(self, takes: tuple[int, ...]) -> tuple[int, ...]:
        """The takes among these whose base is not fixed."""
        return tuple(i for i in takes if i not in self.fixed_base)

    def telling(self, effects: Iterable[Candidate], takes: tuple[int, ...]) -> tuple[int, ...]:
        """The takes among these that identify numbers of effects: where some have a floating base these alone, unless an effect
        is of the whole robot or of the cameras; what fixed-base takes show of a joint or a link has been asked before."""
        floating_base = self.floating_base(takes)
        alone = all(c.effect.layer in ("ground", "inertia") or (c.where and c.effect.layer != "measurement") for c in effects)
        return floating_base if floating_base and alone else takes

    def resettle(self, current: Fit, *more: Candidate) -> tuple[Search, Fit]:
        """`current` with the settled effects, and `more`, fitted again on fixed-base takes, and the search in which these are
        settled: for when an effect was dropped or added."""
        there = [s for s in current.sizes() if self.is_settled(s[0]) or s[0].key in {c.key for c in more}]
        free = self.with_settled(None)
        fitted = free.refit(free.evaluate(there), self.fixed_base, FIT.refit_steps, range(len(there)))
        settled = free.refit_timing(fitted)
        known = settled.sizes_by_key()
        return self.with_settled(settled), self.evaluate([(c, known.get(c.key, x)) for c, x in current.sizes()])

    def refit_timing(self, current: Fit) -> Fit:
        """A fit on fixed-base takes with its timing parameters identified from all takes: contact changes much, but not the times
        of commands. Unchanged if fixed-base takes contradict that: then something else is missing on floating-base takes."""
        timing = [i for i, c in enumerate(current.effects) if c.effect.layer == "timing" and c.size]
        if not timing or not self.floating_base(self.fitted):
            return current
        fit = self.refit(current, self.fitted, FIT.refit_steps, timing)
        if contradicted_by_fixed_base(self, fit, current):
            return current
        numbers = fit.numbers(timing)
        covariance = _with_block(current.covariance, numbers, fit.covariance[np.ix_(numbers, numbers)])
        others = [(s, ~np.isin(s.numbers, numbers)) for s in current.slopes]
        kept = [replace(s, numbers=s.numbers[other], J=s.J[:, other]) for s, other in others if other.any()]
        return replace(fit, covariance=covariance, slopes=(*kept, *fit.slopes))

    def evaluate(self, effects: Sequence[tuple[Candidate, Array]]) -> Fit:
        """Effects as they are, on all takes."""
        return self.side_by_side([self.evaluating(effects)])[0][0]

    def evaluating(self, *lists: Sequence[tuple[Candidate, Array]]) -> Part[list[Fit]]:
        """Several lists of effects as they are, on all takes, as a generator that runs alongside others."""
        answers = yield [RolloutRequest(with_effects(self.nominal, effects), self.takes) for effects in lists]
        out = []
        for effects, residuals in zip(lists, answers):
            x = np.concatenate([np.empty(0), *(x for _, x in effects)])
            out.append(Fit(tuple(c for c, _ in effects), x, np.full((len(x), len(x)), np.inf), self._cost(residuals), residuals))
        return out

    def side_by_side(self, parts: Sequence[Part[T]], report: Callable[[float], None] = lambda share: None) -> list[T]:
        """What several parts return; their rollouts share batches."""
        done = together(dict(enumerate(parts)), lambda wanted: self.evaluator.residuals([q for _, q in wanted]), report)
        return [done[n] for n in range(len(parts))]

    def refit(self, current: Fit, takes: tuple[int, ...], iterations: int, free: Sequence[int] | None = None) -> Fit:
        """Effects' sizes fitted together (all that are not settled, or those listed in `free`), with their covariance."""
        return self.side_by_side([self.refitting(current, takes, iterations, free)])[0]

    def refitting(self, current: Fit, takes: tuple[int, ...], iterations: int, free: Sequence[int] | None = None,
                  step: float = 1.0) -> Part[Fit]:
        """`refit` as a generator that runs alongside others. step: of the time step, in search steps."""
        moved = [i for i, c in enumerate(current.effects) if not self.is_settled(c)] if free is None else list(free)
        moving = current.numbers(moved)
        if not len(moving):
            return self._with_settled_numbers(current)
        takes = self.telling([current.effects[i] for i in moved], takes)
        blocks = self._blocks(current, moved, takes)
        low, high = current.bounds()

        def sizes(point: Sequence[Array]) -> Array:
            x = current.x.copy()
            for numbers, there in zip(blocks.values(), point):
                x[numbers] = there
            return x

        def ask(point: Sequence[Array]) -> RolloutRequest:
            return RolloutRequest(with_effects(self.nominal, current.sizes(sizes(point))), takes, step)

        def as_vectors(answer: dict[int, Array]) -> list[Array]:
            return [self.evaluator.vector(answer, "fit", joint) for joint in blocks]

        # several numbers share what a walk shows: a short move of one drowns
        near = np.concatenate([np.full(c.size, FIT.stride_end if c.size == 1 else FIT.stride_free) for c in current.effects])[
            moving
        ]
        magnitudes = np.concatenate([c.magnitudes(x) for c, x in current.sizes()])[moving]
        start = [current.x[n] for n in blocks.values()]
        answer = {i: current.residuals[i] for i in takes} if step == 1 else (yield [ask(start)])[0]
        stride, least = (near, magnitudes) if self.evaluator.any_floating(takes) else (FIT.stride_fixed, None)
        bounds = [(low[n], high[n]) for n in blocks.values()]
        fit = fit_blocks(start, as_vectors(answer), bounds, iterations, stride, magnitudes=least)
        solved = yield from through(fit, ask, as_vectors)
        x = sizes([s.x for s in solved])
        covariance = np.full((len(x), len(x)), np.inf)
        bent = any(current.effects[i].effect.layer != "timing" for i in moved)
        for s, (joint, numbers) in zip(solved, blocks.items()):
            covariance[np.ix_(numbers, numbers)] = covariance_of(self.evaluator, s, takes, joint, bent)
        slopes = tuple(Slopes(numbers, takes, s.J, joint) for s, (joint, numbers) in zip(solved, blocks.items()))
        (there,) = yield from self.evaluating(current.sizes(x))
        return self._with_settled_numbers(replace(there, covariance=covariance, slopes=slopes))

    def apart(self, c: Candidate, takes: tuple[int, ...]) -> bool:
        """Whether an effect shows in the channels of its own joint alone, on these takes."""
        return c.joint is not None and not c.effect.hidden_by_zeroing and not self.evaluator.any_floating(takes)

    def _blocks(self, current: Fit, moved: Sequence[int], takes: tuple[int, ...]) -> dict[str | None, NDArray[np.int_]]:
        """Numbers (indices of x) that are fitted together, by the joint whose channels identify them, None for all: one rollout
        moves all blocks."""
        if not all(self.apart(current.effects[i], takes) for i in moved):
            return {None: current.numbers(moved)}
        joints = dict.fromkeys(current.effects[i].joint for i in moved)
        return {j: current.numbers(i for i in moved if current.effects[i].joint == j) for j in joints}

    def _with_settled_numbers(self, fit: Fit) -> Fit:
        """The fit with covariance and slopes of those numbers that are settled."""
        if self.settled is None:
            return fit
        where = {c.key: i for i, c in enumerate(self.settled.effects)}
        both = [(i, where[c.key]) for i, c in enumerate(fit.effects) if c.key in where]
        here, there = fit.numbers(i for i, _ in both), self.settled.numbers(k for _, k in both)
        covariance = _with_block(fit.covariance, here, self.settled.covariance[np.ix_(there, there)])
        slopes = []
        for s in self.settled.slopes:
            known = [(n, s.numbers.tolist().index(k)) for n, k in zip(here, there) if k in s.numbers]
            if known:
                slopes.append(replace(s, numbers=np.array([n for n, _ in known]), J=s.J[:, [k for _, k in known]]))
        others = [s for s in fit.slopes if not np.isin(s.numbers, here).any()]
        return replace(fit, covariance=covariance, slopes=(*others, *slopes))

    def refine(self, fit: Fit) -> Fit:
        """The fit with its parameters corrected for finer steps, and its residuals there: the step's error biases parameters by
        several per cent. One Gauss-Newton step with the search's slopes, shortened where it makes things worse; for a single
        parameter that floating-base takes identify, the minimum over a wide range of values. A quarter of the change is added to
        the standard deviation."""
        if not fit.slopes or not np.isfinite(fit.covariance).any():
            return self.finely(fit, self.takes, fit.x)[0]
        before, fit = fit, self._finer(fit)
        walked = fit.numbers([i for i, c in enumerate(fit.effects) if not self.is_settled(c)])
        alone = int(walked[0]) if len(walked) == 1 and self.fixed_base != self.fitted else None
        identified_on_fixed_base = not len(walked) and all(set(s.takes) <= set(self.fixed_base) for s in fit.slopes)
        takes = self.fixed_base if identified_on_fixed_base and self.fixed_base else self.takes
        points = [fit.x] if alone is None else _around(fit, alone)
        seen = self.finely(fit, takes, *points, *([] if before is fit else [before.x]))
        move, start = self._newton(seen[0]), fit.x.copy()
        low, high = fit.bounds()
        if alone is not None:
            move[alone] = 0.0
            start[alone] = _bottom(seen, alone, (low[alone], high[alone]))
        for share in (1.0, 0.4) if alone is None else (1.0,):
            seen += self.finely(fit, takes, np.clip(start + share * move, low, high))
            if seen[-1].cost["fit"] < seen[0].cost["fit"]:
                break
        (best,) = self.finely(fit, self.takes, min(seen, key=lambda f: f.cost["fit"]).x)
        return replace(best, covariance=fit.covariance + np.diag(((best.x - fit.x) / 4) ** 2))

    def _finer(self, fit: Fit) -> Fit:
        """The fit with what floating-base takes identify fitted once more in finer steps, where that is more than one number."""
        if sum(c.size for c in fit.effects if not self.is_settled(c)) < 2 or not self.floating_base(self.fitted):
            return fit
        return self.side_by_side([self.refitting(fit, self.fitted, FIT.finer_steps, step=FIT.finer)])[0]

    def _newton(self, seen: Fit) -> Array:
        """A Gauss-Newton step from a fit's residuals at finer steps, with the search's slopes."""
        move = np.zeros(len(seen.x))
        for s in seen.slopes:
            r = self.evaluator.vector({i: seen.residuals[i] for i in s.takes}, "fit", s.joint)
            H = s.J.T @ s.J
            move[s.numbers] = -np.linalg.lstsq(H + 1e-6 * np.diag(np.diag(H) + 1e-12), s.J.T @ r, rcond=None)[0]
        return move

    def floors(self, fit: Fit) -> dict[int, Array]:
        """Numerical floor (c,) of a refined fit's channels, over sigma, by take: the change when its step is doubled."""
        model = with_effects(self.nominal, fit.sizes())
        longer = self.evaluator.residuals([RolloutRequest(model, self.takes, 2 * PROBLEM.fine)])[0]
        return {i: np.nan_to_num(rms((longer[i] - fit.residuals[i])[self.evaluator.evidence[i].moving])) for i in self.takes}

    def finely(self, fit: Fit, takes: tuple[int, ...], *points: Array) -> list[Fit]:
        """The fit with other sizes, as fine steps judge it."""
        asked = [RolloutRequest(with_effects(self.nominal, fit.sizes(x)), takes, PROBLEM.fine) for x in points]
        return [replace(fit, x=x, cost=self._cost(r), residuals=r) for x, r in zip(points, self.evaluator.residuals(asked))]

    def _cost(self, residuals: dict[int, Array]) -> dict[str, float]:
        return {use: self.evaluator.cost(residuals, use) for use in ("fit", "choose", "validate")}


def gain_between(evaluator: RolloutEvaluator, before: Fit, after: Fit, takes: Sequence[int], use: str) -> float:
    """Reduction of chi squared from one fit to another, in one use of some takes."""
    was, now = (evaluator.cost({i: f.residuals[i] for i in takes}, use) for f in (before, after))
    return was - now


def contradicted_by_fixed_base(search: Search, fit: Fit, other: Fit) -> bool:
    """Whether the fixed-base takes contradict a fit, compared with another: by more than `against` of chi squared."""
    return gain_between(search.evaluator, fit, other, search.fixed_base, "fit") > FIT.against


def _with_block(covariance: Array, numbers: NDArray[np.int_], block: Array) -> Array:
    """A covariance with that of some parameters inserted; their correlation with others is unknown and set to zero."""
    out = covariance.copy()
    out[numbers], out[:, numbers] = np.inf, np.inf
    out[np.ix_(numbers, numbers)] = block
    return out


def _around(fit: Fit, n: int) -> list[Array]:
    """The fit's sizes, and those with number n far on both sides."""
    low, high = fit.bounds()
    x = np.array([fit.x] * 3)
    x[1:, n] *= 1 + FIT.wide, 1 / (1 + FIT.wide)
    return list(np.clip(x, low, high))


def _bottom(seen: Sequence[Fit], n: int, ends: tuple[float, float]) -> float:
    """The value of number n at the bottom of the parabola through three fits, or where the best of them has it."""
    bottom = lowest([(f.x[[n]], f.cost["fit"]) for f in seen], *(np.array([end]) for end in ends))
    return float(min(seen, key=lambda f: f.cost["fit"]).x[n] if bottom is None else bottom[0])
