"""One search: linearise, score moves by the evidence that they predict, fit the best few, keep a beam, stop by evidence."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.identify.evidence.fit import (
    Asks,
    Fitted,
    Key,
    as_published,
    at_typical_sizes,
    drop_effects,
    evaluate,
    fit_from_starts,
    fit_hypothesis,
    polish,
    restart,
    spread,
    with_better,
)
from workbench.identify.evidence.hypothesis import Hypothesis, start
from workbench.identify.evidence.linearise import (
    Move,
    akin,
    best_of_each,
    choose_moves,
    in_pairs,
    linearise,
    linearised_around,
)
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.region import Region
from workbench.identify.fitting.lockstep import side_by_side, together
from workbench.identify.options import PROBLEM
from workbench.identify.parameters import Candidate
from workbench.types import Progress

if TYPE_CHECKING:
    from workbench.identify.evidence.rollouts import Rollouts


@dataclass(frozen=True)
class Found:
    """Fits of one region, by their set of effects; which of these were extended by every other effect, and which were fitted from
    typical sizes again."""

    region: Region
    fits: Mapping[Key, Fitted]
    extended: frozenset[Key] = frozenset()
    restarted: frozenset[Key] = frozenset()

    @property
    def best(self) -> Fitted:
        """The likeliest fit."""
        return max(self.fits.values(), key=lambda f: f.log_posterior)

    def goes_on(self, options: EvidenceOptions) -> bool:
        """Whether the likeliest fit may have a better one beyond it: it was not extended yet."""
        best = self.best.hypothesis
        return best.key not in self.extended and len(best.effects) < options.most

    def is_near(self, f: Fitted, options: EvidenceOptions) -> bool:
        """Whether another fit of its model could still make it the likeliest."""
        return f.log_posterior > self.best.log_posterior - 3 * options.occam

    def beam(self, options: EvidenceOptions) -> list[Fitted]:
        """The most probable fits, few enough to continue with."""
        return sorted(self.fits.values(), key=lambda f: -f.log_posterior)[:options.beam]


def search(rollouts: Rollouts, options: EvidenceOptions, report: Progress) -> tuple[Rollouts, tuple[Found, ...]]:
    """Searches all regions in lockstep, level by level; returns them with the best fits of each."""
    return complete_search(*recalibrate_nominal(rollouts, options, report), rollouts.step, options, report)


def recalibrate_nominal(rollouts: Rollouts, options: EvidenceOptions, report: Progress) -> tuple[Rollouts, tuple[Found, ...]]:
    """The nominal law recalibrated in all regions, at the coarse step of exploring."""
    report("the nominal law recalibrated", None)
    rollouts = replace(rollouts, step=PROBLEM.coarse, horizon=options.horizon)
    first = lockstep(rollouts, {i: _begin(r, options) for i, r in enumerate(rollouts.regions)})
    found = tuple(Found(r, {f.hypothesis.key: f}) for r, f in (first[i] for i in range(len(first))))
    return with_best(rollouts, found), found


def complete_search(rollouts: Rollouts, found: Sequence[Found], step: float, options: EvidenceOptions, report: Progress,
                    horizon: float | None = None) -> tuple[Rollouts, tuple[Found, ...]]:
    """Continues to the end of the search. step, horizon [s]: of rollouts by which it is judged; None: `_judging_horizon`.

    Only the closest model reveals the correlation time of the errors, since the residuals of a poorer one are correlated by its
    missing effects (Mallows' Cp takes the noise from the largest model for the same reason). So the search explores first, as if
    the time were at most `options.explored` and at a coarse step, and then judges its fits, and continues, by the residuals of
    the closest fits. It explores in windows, and judges by whole logs only where these are as informative (`_judging_horizon`).
    """
    rollouts, states = _all_levels(rollouts.around_here(PROBLEM.coarse, options.horizon), list(found), options, True, report)
    here = rollouts.around_here(step, _judging_horizon(rollouts, states, options) if horizon is None else horizon)
    rollouts, states = _all_levels(here, states, options, False, report)
    return rollouts, tuple(states)


def _judging_horizon(rollouts: Rollouts, found: Sequence[Found], options: EvidenceOptions) -> float:
    """Horizon by which models are judged [s]: that of windows, or infinity for whole logs. The residuals of a correct model grow
    little over a log, and then the whole log is most informative, as no window starts from a noisy state; where stick and slip
    dominate the residuals after seconds, they grow by several times, at random (`options.grown`)."""
    if not np.isfinite(options.horizon):
        return options.horizon
    whole = rollouts.around_here(rollouts.step, np.inf)
    left = whole.answers([(i, f.best.hypothesis) for i, f in enumerate(found)])
    grown = [np.log(f.region.likelihood.discrepancy(r) / f.region.likelihood.discrepancy(f.best.r)) for f, r in zip(found, left)]
    return np.inf if np.mean(grown) < np.log(options.grown) else options.horizon


def continue_search(rollouts: Rollouts, found: Sequence[Found], options: EvidenceOptions, report: Progress
                    ) -> tuple[Rollouts, tuple[Found, ...]]:
    """Continues the search from these fits, for instance after names were removed."""
    rollouts, on = _all_levels(with_best(rollouts, found), list(found), options, False, report)
    return rollouts, tuple(on)


def _all_levels(rollouts: Rollouts, found: list[Found], options: EvidenceOptions, exploring: bool, report: Progress
                ) -> tuple[Rollouts, list[Found]]:
    """Level by level until no region's best fit has anything to be added, dropped or exchanged."""
    what = "exploring" if exploring else "judging"

    def everywhere(part: Callable[[Found], Asks[Found]], these: Collection[int]) -> None:
        nonlocal rollouts, found
        done = lockstep(rollouts, {i: part(found[i]) for i in sorted(these)})
        found = [done.get(i, f) for i, f in enumerate(found)]
        rollouts = with_best(rollouts, found)

    everywhere(lambda f: _renew_correlation(f, options, exploring, True), range(len(found)))
    if not exploring:
        everywhere(lambda f: _refit(f, options), range(len(found)))
    open_ = set(range(len(found)))
    for level in range(options.most if not rollouts.exhausted else 0):
        report(f"effects, {what}, level {level + 1}", level / options.most)
        everywhere(lambda f: _level(f, options), open_)
        if not exploring:
            everywhere(lambda f: _exchange(f, options), open_)
        everywhere(lambda f: _renew_correlation(f, options, exploring, len(found) > 1), range(len(found)))  # other joints moved
        open_ = {i for i in open_ if found[i].goes_on(options)}
        if not open_ or rollouts.exhausted:
            break
    return rollouts, found


def _begin(region: Region, options: EvidenceOptions) -> Asks[tuple[Region, Fitted]]:
    """The nominal law recalibrated."""
    h = start(region.numbers)
    (r,) = yield [h]
    region = region.with_correlation_time(min(options.explored, region.correlation(r)))
    s = region.likelihood.discrepancy(r)
    return region, (yield from fit_from_starts(region, options, spread(h, options.starts), s))


def _level(found: Found, options: EvidenceOptions) -> Asks[Found]:
    """The beam's states extended by the moves that predict most, and those fitted."""
    return (yield from _extend(found, options, found.beam(options), options.refined))


def _exchange(found: Found, options: EvidenceOptions) -> Asks[Found]:
    """If the best fit cannot be extended to a better one: drops each of its effects in turn, fitted from the current parameters,
    so that a poorly converged smaller model does not justify an extra effect; exchanges each for others; and fits the models of
    `_starts_again` from other starting points."""
    if found.best.hypothesis.key not in found.extended:
        return found
    best, region = found.best, found.region
    states = [drop_effects(best, lambda c, gone=gone: c is gone) for gone in best.hypothesis.effects]
    made = yield from side_by_side([fit_hypothesis(region, options, h, best.discrepancy, options.iterations, None, J)
                                    for h, J in states])
    fits = with_better(found.fits, made)
    again = _starts_again(found, options)
    made = yield from restart(region, options, list(again.values()), best)
    fits = with_better(fits, [*made, *(reduce(region, options, f) for f in made)])
    found = replace(found, fits=fits, restarted=found.restarted | frozenset(again))
    return (yield from _extend(found, options, [fits[h.key] for h, _ in states], options.beam))


def _starts_again(found: Found, options: EvidenceOptions) -> dict[Key, list[Hypothesis]]:
    """Starting points, by set of effects, of the best models from typical sizes, and of those that differ from the best in one
    effect of the same kind: linear predictions hardly find a saturation where a ceiling was fitted. Each model only once."""
    near = [f.hypothesis for f in found.beam(options) if found.is_near(f, options)]
    again: dict[Key, list[Hypothesis]] = {}
    for starts in (*akin(found.region, options, found.best.hypothesis),
                   *([at_typical_sizes(h, share) for share in options.sizes] for h in near)):
        if starts[0].effects and starts[0].key not in found.restarted:
            again.setdefault(starts[0].key, []).extend(starts)
    return again


def _extend(found: Found, options: EvidenceOptions, states: Sequence[Fitted], refined: int) -> Asks[Found]:
    """Extends states, each by so many of the moves with the largest predicted gain; fits those, and polishes the beam."""
    fits, region, moves = dict(found.fits), found.region, []
    states = [f for f in states if f.hypothesis.key not in found.extended and len(f.hypothesis.effects) < options.most]
    published: dict[Key, Move] = {}
    for f in states:
        alone = yield from linearise(region, options, f)
        if not f.hypothesis.effects:
            published = {m.hypothesis.key: m for m in (yield from _from_published(region, options, f))}
            least = dict.fromkeys((m.hypothesis.key for m in alone), -np.inf) | {key: m.gain for key, m in published.items()}
            alone = sorted((replace(m, gain=max(m.gain, least[m.hypothesis.key])) for m in alone), key=lambda m: -m.gain)
        alone, both = ([m for m in each if m.hypothesis.key not in fits]
                       for each in (alone, best_of_each(in_pairs(region, options, f, alone))))
        moves += [(f, m) for m in choose_moves(alone, both, options)[:refined]]
    wanted: dict[Key, tuple[Fitted, Move]] = {}
    for f, m in sorted(moves, key=lambda fm: -(fm[0].log_posterior + fm[1].gain)):
        wanted.setdefault(m.hypothesis.key, (f, m))
    made = yield from side_by_side([_fit_move(region, options, f, m, published.get(key)) for key, (f, m) in wanted.items()])
    fits |= {f.hypothesis.key: f for f in made}
    ahead = sorted(fits.values(), key=lambda f: -f.log_posterior)[:options.beam]
    better = yield from side_by_side([polish(region, options, f) for f in ahead])
    fits = with_better(fits, [*better, *(reduce(region, options, f) for f in (*made, *better))])
    return replace(found, fits=fits, extended=found.extended | {f.hypothesis.key for f in states})


def _from_published(region: Region, options: EvidenceOptions, f: Fitted) -> Asks[list[Move]]:
    """Every effect alone, with its gain predicted around the nominal law as it stands; gains compared with a plain fit f. A plain
    fit adjusts the law for want of the effect, and predicts its size badly."""
    h = start(region.numbers)
    if not len(h.theta):
        return []
    there, moves = yield from linearised_around(region, options, h)
    return [replace(m, gain=m.gain + there.log_posterior - f.log_posterior) for m in moves]


def reduce(region: Region, options: EvidenceOptions, f: Fitted) -> Fitted:
    """A fit without the effects, and without the options of effects, that came to nothing in it: a smaller model must not lose
    because it was searched for less."""
    h, remain = f.hypothesis.without_zero()
    return f if remain.all() else evaluate(region, options, h, f.r, f.J[:, remain])


def _fit_move(region: Region, options: EvidenceOptions, f: Fitted, m: Move, published: Move | None = None) -> Asks[Fitted]:
    """A move fitted, with the slopes that predicted it where they tell all its numbers; and once more from the nominal law as it
    stands, with the size that it predicts (published), as a law recalibrated for want of an effect may hold a fit where it is."""
    shaped = any(c.shapes.any() or c.size > 1 for c in m.added)
    h = m.hypothesis
    s, J = f.discrepancy, None if shaped else m.J
    fits = yield from side_by_side([
        fit_hypothesis(region, options, h, s, options.iterations, None, J),
        fit_hypothesis(region, options, as_published(h), s, options.iterations, None, J) if published is None else
        fit_hypothesis(region, options, published.hypothesis, s, options.iterations)])
    return max(fits, key=lambda g: g.log_posterior)  # type: ignore[no-any-return]


def _renew_correlation(found: Found, options: EvidenceOptions, exploring: bool, again: bool) -> Asks[Found]:
    """The fits judged by the correlation time of the closest residuals: the median of a few, as a single estimate is poor.
    again: rolled out again, because other regions have changed, or the step has."""
    near = [f for f in found.fits.values() if exploring or found.is_near(f, options)]
    left = [f.r for f in near]
    if again:
        left = yield [f.hypothesis for f in near]
    closest = sorted(left, key=found.region.likelihood.discrepancy)[:options.beam]
    tau = float(np.median([found.region.correlation(r) for r in closest]))
    region = found.region.with_correlation_time(min(tau, options.explored) if exploring else tau)
    fits = {f.hypothesis.key: evaluate(region, options, f.hypothesis, x, f.J) for f, x in zip(near, left)}
    return replace(found, region=region, fits=fits)


def _refit(found: Found, options: EvidenceOptions) -> Asks[Found]:
    """The most probable fits continued, and repeated from the nominal law, at the finer step and the new correlation time:
    otherwise fits that have not converged there would be compared with fits that have."""
    region = found.region
    near = [f for f in sorted(found.fits.values(), key=lambda f: -f.log_posterior) if found.is_near(f, options)][:options.refined]
    made = yield from side_by_side([
        *(polish(region, options, f) for f in near),
        *(fit_hypothesis(region, options, as_published(f.hypothesis), f.discrepancy, options.iterations) for f in near)])
    return replace(found, fits=with_better(found.fits, [*made, *(reduce(region, options, f) for f in made)]))


def with_fits(found: Found, fits: Sequence[Fitted], options: EvidenceOptions) -> Found:
    """The search's result with more fits, as far as they have the same uncertain numbers."""
    mine = [evaluate(found.region, options, f.hypothesis, f.r, f.J) for f in fits if f.hypothesis.numbers == found.region.numbers]
    return replace(found, fits=with_better(found.fits, mine))


def lockstep(rollouts: Rollouts, parts: Mapping[int, Generator[Any, Any, Any]]) -> dict[int, Any]:
    """Results of generators of several regions, whose rollouts are shared."""
    return together(dict(parts), rollouts.answers)


def without_names(found: Found, options: EvidenceOptions, gone: Collection[Candidate]) -> Asks[Found]:
    """Without all fits that have one of these effects, which are not to be tried again; the best of them is fitted without these
    effects from its current parameters, as there may be no other fit."""
    names, best = {c.key for c in gone}, found.best
    h, J = drop_effects(best, lambda c: c.key in names)
    fit = yield from fit_hypothesis(found.region, options, h, best.discrepancy, options.iterations, None, J)
    fits = {key: f for key, f in found.fits.items() if not any(c.key in names for c in f.hypothesis.effects)}
    region = replace(found.region, candidates=tuple(c for c in found.region.candidates if c.key not in names))
    return replace(found, region=region, fits=with_better(fits, [fit]))


def with_best(rollouts: Rollouts, found: Sequence[Found]) -> Rollouts:
    """The rollouts with the best fit of each region as its hypothesis."""
    return replace(rollouts, regions=tuple(f.region for f in found), standing=tuple(f.best.hypothesis for f in found))
