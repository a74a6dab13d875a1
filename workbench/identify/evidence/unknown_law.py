"""An unnamed torque as a competitor of the named effects, judged by the same evidence.

The vocabulary of effects is closed: physics that none of them describes is given the nearest name, and confidently, as all the
other names are worse. Each model of the search is therefore also tried with a torque that nobody has named (`torque_law`), and
with fewer names. Its weights are linear parameters of the torque with a normal prior; over windows residuals answer to
them nearly linearly, so that groups and their scales are chosen by linear algebra on one set of slopes, and few rollouts follow.
The probability of a name is then conditional on such a law being allowed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from workbench.identify.evidence.fit import (
    Asks,
    Fitted,
    drop_effects,
    evaluate,
    fit_hypothesis,
    slopes,
    with_better,
)
from workbench.identify.evidence.hypothesis import Hypothesis, Prior, log_odds, start
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.region import Region
from workbench.identify.evidence.search import Found
from workbench.identify.evidence.torque_law import TorqueLaw
from workbench.identify.fitting.lockstep import side_by_side
from workbench.types import Array, Mask

if TYPE_CHECKING:
    from workbench.identify.parameters import Candidate

Scales = Mapping[str, float]


@dataclass(frozen=True)
class _State:
    """A hypothesis with a law, and measurements there or near: r (n,), J (n, k) by theta, B (n, M) by all weights."""

    h: Hypothesis
    r: Array = field(repr=False)
    J: Array = field(repr=False)
    B: Array = field(repr=False)

    @property
    def law(self) -> TorqueLaw:
        assert self.h.law is not None
        return self.h.law


@dataclass(frozen=True)
class _Predicted:
    """The state that linear algebra predicts from another. r (n,): predicted residuals; log_posterior [nats]."""

    h: Hypothesis
    r: Array = field(repr=False)
    log_posterior: float


def with_unknown_law(found: Found, options: EvidenceOptions, law: TorqueLaw) -> Asks[Found]:
    """The models of a region, with those that have an unnamed torque, unless none is predicted to be competitive.
    law: of weight 0."""
    region, best = found.region, found.best
    bases = [best]
    if best.hypothesis.effects:
        bare = yield from fit_hypothesis(region, options, start(region.numbers), best.discrepancy, options.iterations)
        bases.append(bare)
    states = []
    for f in bases:
        h = replace(f.hypothesis, law=law)
        B = yield from _by_weights(h, f.r, options.law.probe * law.full_torque, np.ones(len(law.weights), dtype=bool))
        states.append(_State(h, f.r, f.J, B))
    # the correlation time of the residuals of the most flexible law, as Mallows' Cp takes the noise from the largest model
    flexible = dict.fromkeys(law.groups, max(options.law.shares) * law.full_torque)
    closest = min(region.correlation(_solve(region, options, at, flexible).r) for at in states)
    shorter = region.with_correlation_time(min(region.likelihood.tau, closest))
    least = evaluate(shorter, options, best.hypothesis, best.r, best.J).log_posterior
    predicted = [_predict_groups(shorter, options, at).log_posterior for at in states]
    if max(predicted) < least - options.law.behind:
        return found
    made: list[Fitted] = []
    for at, nats in zip(states, predicted):
        if nats > least - 3 * options.law.behind:
            made += yield from _follow(shorter, options, at)
    return _with(found, made, options)


def on_windows(found: Found, options: EvidenceOptions) -> Asks[Found]:
    """The most probable model of a region alone, judged by rollouts over windows, to which residuals of a law respond linearly;
    over whole logs they hardly do."""
    best = found.best
    (r,) = yield [best.hypothesis]
    region = found.region.with_correlation_time(min(options.explored, found.region.correlation(r)))
    J = yield from slopes(options, best.hypothesis, r)
    fit = evaluate(region, options, best.hypothesis, r, J)
    return replace(found, region=region, fits={fit.hypothesis.key: fit})


def carried_on(found: Found, windows: Found, options: EvidenceOptions) -> Asks[Found]:
    """A region's models with the likeliest ones that have an unnamed torque on windows, fitted from there to whole logs."""
    ahead = sorted((f for f in windows.fits.values() if f.hypothesis.law is not None), key=lambda f: -f.log_posterior)
    made = []
    for f in ahead[:options.beam]:
        (r,) = yield [f.hypothesis]
        nothing = np.zeros((len(r), len(f.hypothesis.law.weights)))  # type: ignore[union-attr]
        at = yield from _measure_slopes(options, _State(f.hypothesis, r, nothing[:, :0], nothing))
        region = found.region.with_correlation_time(min(found.region.likelihood.tau, found.region.correlation(r)))
        at = yield from _fit(region, options, at, options.law.iterations)
        made.append(_as_fit(region, options, at))
    return _with(found, made, options)


def _with(found: Found, made: Sequence[Fitted], options: EvidenceOptions) -> Found:
    """The result with these fits, all judged by the correlation time of the closest ones' residuals; the likelier fit of each set
    of effects and groups is kept."""
    every = [*found.fits.values(), *(without_zero_groups(f) for f in made)]
    closest = sorted(every, key=lambda f: f.discrepancy)[:options.beam]
    alike = [f.r for f in closest if f.discrepancy < options.grown * closest[0].discrepancy]
    region = found.region.with_correlation_time(float(np.median([found.region.correlation(r) for r in alike])))
    fits = [evaluate(region, options, f.hypothesis, f.r, f.J, f.law_slopes) for f in every]
    return replace(found, region=region, fits=with_better({}, fits))


def without_zero_groups(f: Fitted) -> Fitted:
    """A fit without the groups of its law whose weights are all zero, which remain where no step from zero was an improvement;
    without a law if that is all of them."""
    law = f.hypothesis.law
    if law is None or f.law_slopes is None:
        return f
    used = {g for g, w in zip(law.group_of, law.weights) if w}
    if used == set(law.scales):
        return f
    kept = law.at(law.weights, {g: s for g, s in law.scales.items() if g in used})
    columns = np.isin(np.array(law.group_of)[law.active], list(used))
    return replace(f, hypothesis=replace(f.hypothesis, law=kept if used else None),
                   law_slopes=f.law_slopes[:, columns] if used else None)


def _follow(region: Region, options: EvidenceOptions, at: _State) -> Asks[list[Fitted]]:
    """A state fitted, then without each of its effects in turn as long as that is likelier: a name that the law makes needless
    was none."""
    made: list[Fitted] = []
    at = yield from _fit(region, options, at, options.law.iterations)
    now = _as_fit(region, options, at)
    made.append(now)
    while at.h.effects:
        fewer = yield from side_by_side([_without(region, options, at, c) for c in at.h.effects])
        fits = [_as_fit(region, options, other) for other in fewer]
        made += fits
        k = int(np.argmax([f.log_posterior for f in fits]))
        if fits[k].log_posterior < now.log_posterior - options.law.behind:
            break
        at = yield from _fit(region, options, fewer[k], 1)
        now = _as_fit(region, options, at)
        made.append(now)
    return made


def _without(region: Region, options: EvidenceOptions, at: _State, gone: Candidate) -> Asks[_State]:
    """A state without one of its effects, the rest led after that with the slopes that are known."""
    h, J = drop_effects(_as_fit(region, options, at), lambda c: c is gone)
    (r,) = yield [h]
    return (yield from _step(region, options, _State(h, r, J, at.B), 2))


def _fit(region: Region, options: EvidenceOptions, at: _State, iterations: int) -> Asks[_State]:
    """Gauss and Newton's steps; after each the slopes are measured again."""
    for _ in range(iterations):
        before = at
        at = yield from _step(region, options, at, 1)
        at = yield from _measure_slopes(options, at)
        if before.law.scales and _as_fit(region, options, at).log_posterior < _as_fit(region, options, before).log_posterior:
            return before
        if np.array_equal(at.h.theta, before.h.theta) and np.array_equal(at.law.weights, before.law.weights):
            break
    return at


def _step(region: Region, options: EvidenceOptions, at: _State, steps: int) -> Asks[_State]:
    """Steps to where linear algebra leads, as far as rollouts agree, with the slopes that are known."""
    for _ in range(steps):
        p = _predict_groups(region, options, at)
        assert p.h.law is not None
        here = at.h.at(at.h.theta)
        here = replace(here, law=at.law.at(at.law.weights, p.h.law.scales))
        shares = options.law.shares_of_step
        trials = [_between(here, p.h, share) for share in (0.0, *shares)]
        left = yield trials
        s = region.likelihood.discrepancy(min(left, key=region.likelihood.discrepancy))
        values = [_objective(region, options, h, r, s) for h, r in zip(trials, left)]
        k = int(np.argmax(values))
        at = _State(trials[k], left[k], at.J, at.B)
        if k == 0:
            break
    return at


def _between(a: Hypothesis, b: Hypothesis, share: float) -> Hypothesis:
    """A share of the way from one hypothesis to another of the same effects and groups."""
    assert a.law is not None
    assert b.law is not None
    law = b.law.at(a.law.weights + share * (b.law.weights - a.law.weights))
    return replace(a.at(a.theta + share * (b.theta - a.theta)), law=law)


def _objective(region: Region, options: EvidenceOptions, h: Hypothesis, r: Array, s: float) -> float:
    """Log likelihood and log prior, at a discrepancy s [nats]."""
    assert h.law is not None
    return region.likelihood.log(r, s) + Prior.of(h, options).log(h.theta) + h.law.log_prior


def _measure_slopes(options: EvidenceOptions, at: _State) -> Asks[_State]:
    """A state with its slopes measured there, those of weights that are not there left as they are."""
    J = yield from slopes(options, at.h, at.r)
    B = at.B.copy()
    active = at.law.active
    B[:, active] = (yield from _by_weights(at.h, at.r, options.law.probe * at.law.full_torque, active))[:, active]
    return _State(at.h, at.r, J, B)


def _by_weights(h: Hypothesis, r: Array, weight: float, which: Mask) -> Asks[Array]:
    """Slopes (n, M) of r by some of the law's weights, from differences of `weight` [N m]; 0 of others."""
    assert h.law is not None
    B = np.zeros((len(r), len(h.law.weights)))
    asked = np.flatnonzero(which)
    left = (yield [replace(h, law=h.law.moved(int(k), weight)) for k in asked]) if len(asked) else []
    for k, moved in zip(asked, left):
        B[:, k] = (moved - r) / weight
    return B


def slopes_by_law(options: EvidenceOptions, f: Fitted) -> Asks[Array | None]:
    """Slopes (n, m) of a fit's residuals by the weights of its unnamed torque; None without one."""
    law = f.hypothesis.law
    if law is None:
        return None
    B = yield from _by_weights(f.hypothesis, f.r, options.law.probe * law.full_torque, law.active)
    return np.asarray(B[:, law.active])


def _as_fit(region: Region, options: EvidenceOptions, at: _State) -> Fitted:
    return evaluate(region, options, at.h, at.r, at.J, at.B[:, at.law.active])


def _predict_groups(region: Region, options: EvidenceOptions, at: _State) -> _Predicted:
    """The most probable groups (at least one) and scales of a law together with a state's effects, by linear algebra. Groups are
    added one by one while that pays, each at its best scale given the others."""
    best, chosen = None, dict[str, float]()
    scales = [share * at.law.full_torque for share in options.law.shares]
    while tries := [(_solve(region, options, at, chosen | {g: s}), chosen | {g: s})
                    for g in at.law.groups if g not in chosen for s in scales]:
        p, with_it = max(tries, key=lambda t: t[0].log_posterior)
        if best is not None and p.log_posterior <= best.log_posterior:
            break
        best, chosen = p, with_it
        for g in [*chosen][:-1]:  # what an earlier one needs is another size now
            again = [(_solve(region, options, at, chosen | {g: s}), chosen | {g: s}) for s in scales if s != chosen[g]]
            other, those = max(again, key=lambda t: t[0].log_posterior)
            if other.log_posterior > best.log_posterior:
                best, chosen = other, those
    assert best is not None
    return best


def _solve(region: Region, options: EvidenceOptions, at: _State, scales: Scales) -> _Predicted:
    """Theta and the weights of some groups together, by reweighted least squares on a state's slopes."""
    law, likelihood = at.law.at(at.law.weights, scales), region.likelihood
    there, prior, k = law.active, Prior.of(at.h, options), len(at.h.theta)
    r0 = at.r + at.B[:, ~there] @ (0.0 - at.law.weights[~there])
    A = np.hstack([at.J, at.B[:, there]])
    x0 = np.concatenate([at.h.theta, law.weights[there]])
    center = np.concatenate([prior.center, np.zeros(int(there.sum()))])
    low, high = at.h.bounds()
    x, r = x0, r0
    for _ in range(options.law.reweighted):
        s = likelihood.discrepancy(r)
        W = likelihood.precision(r, s)
        P = np.concatenate([prior.precision(x[:k]), law.precision])
        step = np.linalg.solve((A.T * W) @ A + np.diag(P), A.T @ (W * r0) + P * (x0 - center))
        x = x0 - step
        x[:k] = np.clip(x[:k], low, high)
        r = r0 + A @ (x - x0)
    s = likelihood.discrepancy(r)
    P = np.concatenate([prior.precision(x[:k]), law.precision])
    H = (A.T * likelihood.precision(r, s)) @ A + np.diag(P)
    weights = law.weights.copy()
    weights[there] = x[k:]
    law = law.at(weights)
    h = replace(at.h.at(x[:k]), law=law)
    evidence = likelihood.log(r, s) + prior.log(x[:k]) + law.log_prior + 0.5 * len(x) * np.log(2 * np.pi)
    parts = len(h.effects) + sum(len(c.options) for c in h.effects) + len(scales)
    price = parts * log_odds(len(region.candidates), options.expected)
    return _Predicted(h, r, float(evidence - 0.5 * np.linalg.slogdet(H)[1] + price))
