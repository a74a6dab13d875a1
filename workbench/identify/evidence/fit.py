"""A hypothesis fitted, with its evidence; fits ask for rollouts as generators, so that many share one batch."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from scipy.linalg import hadamard

from workbench.identify.evidence.hypothesis import Hypothesis, Prior, Term, log_odds, split_sums
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.fitting.levenberg_marquardt import Solved, fit_blocks
from workbench.types import Array

if TYPE_CHECKING:
    from workbench.identify.evidence.region import Region

T = TypeVar("T")
Key = frozenset[Term]
Asks = Generator[list[Hypothesis], list[Array], T]
"""Yields hypotheses to be rolled out, is sent the residuals (n,) [rad] that each leaves."""


@dataclass(frozen=True)
class Fitted:
    """r (n,): residuals [rad]; J (n, k): of r by theta; discrepancy [rad]; log_evidence [nats]; log_prior [nats]: of the set of
    effects; noise_information (k, k): apparent information in J that is only noise of J, where that is known; law_slopes (n, m):
    of r by the weights of an unnamed torque, where it has one."""

    hypothesis: Hypothesis
    r: Array = field(repr=False)
    J: Array = field(repr=False)
    discrepancy: float
    log_evidence: float
    log_prior: float
    noise_information: Array | None = field(default=None, repr=False)
    law_slopes: Array | None = field(default=None, repr=False)

    @property
    def log_posterior(self) -> float:
        """Logarithm of the posterior, up to a constant [nats]."""
        return self.log_evidence + self.log_prior

    def covariance(self, region: Region, options: EvidenceOptions) -> Array:
        """Covariance of theta (k, k)."""
        h, likelihood = self.hypothesis, region.likelihood
        H = (self.J.T * likelihood.precision(self.r, self.discrepancy)) @ self.J
        if self.noise_information is not None:
            eigenvalues, axes = np.linalg.eigh(H - self.noise_information)
            H = (axes * np.maximum(eigenvalues, 0.0)) @ axes.T
        H = H + np.diag(Prior.of(h, options).precision(h.theta))
        if self.law_slopes is not None and h.law is not None:  # what the weights could take over is not known
            W = likelihood.precision(self.r, self.discrepancy)[:, None] * self.law_slopes
            taken = np.linalg.solve(self.law_slopes.T @ W + np.diag(h.law.precision), W.T @ self.J)
            H = _at_least(H - (self.J.T @ W) @ taken, Prior.of(h, options).precision(h.theta))
        return np.asarray(np.linalg.inv(H))


def with_better(fits: Mapping[Key, Fitted], more: Sequence[Fitted]) -> dict[Key, Fitted]:
    """The likelier fit of each set of effects."""
    out = dict(fits)
    for f in more:
        out[f.hypothesis.key] = max(f, out.get(f.hypothesis.key, f), key=lambda g: g.log_posterior)
    return out


def weights_covariance(f: Fitted, region: Region, options: EvidenceOptions) -> Array:
    """Covariance of the weights of a fit's unnamed torque (m, m) [(N m)^2]."""
    assert f.hypothesis.law is not None
    assert f.law_slopes is not None
    A = np.hstack([f.J, f.law_slopes])
    P = np.concatenate([Prior.of(f.hypothesis, options).precision(f.hypothesis.theta), f.hypothesis.law.precision])
    H = (A.T * region.likelihood.precision(f.r, f.discrepancy)) @ A + np.diag(P)
    return np.asarray(np.linalg.inv(H)[f.J.shape[1]:, f.J.shape[1]:])


def _at_least(H: Array, prior: Array) -> Array:
    """Information (k, k) that is nowhere less than the prior's (k,)."""
    scale = np.sqrt(prior)
    eigenvalues, axes = np.linalg.eigh(H / np.outer(scale, scale))
    return np.asarray(np.outer(scale, scale) * ((axes * np.maximum(eigenvalues, 1.0)) @ axes.T))


def evaluate(region: Region, options: EvidenceOptions, h: Hypothesis, r: Array, J: Array, law_slopes: Array | None = None
             ) -> Fitted:
    """A hypothesis with its evidence at its own parameters, sums split by the prior (`split_sums`). law_slopes (n, m): slopes by
    the weights of its unnamed torque."""
    h, J = split_sums(h, J, options)
    prior = Prior.of(h, options)
    density, precision, slopes = prior.log(h.theta), prior.precision(h.theta), J
    parts = len(h.effects) + sum(len(c.options) for c in h.effects)
    if h.law is not None and law_slopes is not None:
        density, precision = density + h.law.log_prior, np.concatenate([precision, h.law.precision])
        slopes, parts = np.hstack([J, law_slopes]), parts + len(h.law.scales)
    log, s = region.likelihood.evidence(r, slopes, density, precision)
    odds = parts * log_odds(len(region.candidates), options.expected)
    return Fitted(h, r, J, s, log, odds, law_slopes=law_slopes)


def fit_hypothesis(region: Region, options: EvidenceOptions, start: Hypothesis, s: float, iterations: int, r: Array | None = None,
                   J: Array | None = None) -> Asks[Fitted]:
    """Fits a hypothesis from its current parameters, at a discrepancy s. r, J: residuals there and their derivatives by theta, if
    known; else they are requested."""
    prior, seen = Prior.of(start, options), dict[bytes, Array]()
    low, high = start.bounds()
    start = start.at(np.clip(start.theta, low, high))
    if r is None:
        (r,) = yield [start]

    def rows(h: Hypothesis, left: Array) -> Array:
        seen[h.theta.tobytes()] = left
        return np.concatenate([region.likelihood.rows(left, s), prior.rows(h.theta)])

    first = rows(start, r)
    since = [] if J is None else [Solved(start.theta, first, np.vstack([region.likelihood.slope(r, s)[:, None] * J,
                                                                         _prior_slopes(prior, start.theta)]))]
    fit = fit_blocks([start.theta], [first], [(low, high)], iterations, options.stride, since, np.ones(len(start.theta)))
    try:
        points = next(fit)
        while True:
            hypotheses = [start.at(p[0]) for p in points]
            answers = yield hypotheses
            points = fit.send([[rows(h, left)] for h, left in zip(hypotheses, answers)])
    except StopIteration as end:
        (solved,) = end.value
    there = start.at(solved.x)
    left = seen[there.theta.tobytes()]
    J_there = solved.J[:len(left)] / region.likelihood.slope(left, s)[:, None] if len(solved.x) else np.zeros((len(left), 0))
    return evaluate(region, options, there, left, J_there)


def polish(region: Region, options: EvidenceOptions, f: Fitted) -> Asks[Fitted]:
    """A fit continued at its own discrepancy, with new slopes."""
    return (yield from fit_hypothesis(region, options, f.hypothesis, f.discrepancy, options.iterations, f.r))


def regress(region: Region, options: EvidenceOptions, f: Fitted) -> Asks[Fitted]:
    """A fit with slopes J by regression on simultaneous moves of all parameters, in both directions, as far as `options.spread`:
    signs of a Hadamard matrix, so that every move informs every parameter (R. Plackett and J. Burman, Biometrika 33, 1946).

    The response of a sticking joint to a small move is random; one-at-a-time differences take it for slopes, and its square for
    information: two parameters with the same effect would seem to be separable, and both well known. The residuals of the
    regression estimate the random part, which is subtracted (W. Fuller, Measurement error models, 1987).
    An effect that adds to a constant of the law which is recalibrated as well (dry friction) has the same response: the recording
    shows their sum alone. Where it takes from the constant, the slope of the recalibration is the mean one as far down as that:
    it is proportional to the constant, and far less near nothing than at the fit.
    """
    h, k = f.hypothesis, len(f.hypothesis.theta)
    low, high = h.bounds()
    signs = hadamard(1 << (4 * k).bit_length())[:, 1:k + 1]  # four and more pairs of moves to a number
    moves = options.spread * np.linspace(0.5, 1.5, len(signs))[:, None] * signs  # each a different one, however few numbers
    there, back = (np.clip(h.theta + way * moves, low, high) for way in (1, -1))
    left = np.array((yield [h.at(theta) for theta in (*there, *back)]))
    moved, answer = there - back, left[:len(signs)] - left[len(signs):]
    J = np.asarray(np.linalg.lstsq(moved, answer, rcond=None)[0].T, dtype=float)
    chance = np.square(answer - moved @ J.T).sum(axis=0) / (len(signs) - k)
    precision = region.likelihood.precision(f.r, f.discrepancy)
    for k, i in h.alike():
        J[:, [k, i]] = _of_rank_one(J[:, [k, i]], precision)
        if (ratio := _recalibrated_instead(h, k, i)) is not None:
            J[:, k] = ratio * J[:, i]
    scatter = np.asarray(np.linalg.pinv(moved.T @ moved), dtype=float)
    return replace(f, J=J, noise_information=float(precision @ chance) * scatter)


def _of_rank_one(J: Array, precision: Array) -> Array:
    """Slopes (n, 2) of two parameters with the same response: the nearest ones that are multiples of each other."""
    along = np.linalg.svd(np.sqrt(precision)[:, None] * J, full_matrices=False)[2][0]
    return np.asarray(np.outer(J @ along, along))


def _recalibrated_instead(h: Hypothesis, k: int, i: int) -> float | None:
    """How many units of an effect's size (number i of theta) that takes from a constant a standard deviation of its recalibration
    (number k) replaces, on average over all that is taken; None of an effect that takes nothing."""
    c = next(c for c, s in zip(h.effects, h.slices()) if s.start == i)
    if not c.less or not h.theta[i] > 0:
        return None
    sd, z = h.numbers[k].sd, h.theta[k]
    left = np.exp(sd * z) + c.values([h.theta[i]])[0] / -c.least[0]
    return float(h.theta[i] / (np.log(left) / sd - z)) if left > 0 else 0.0


def slopes(options: EvidenceOptions, h: Hypothesis, r: Array) -> Asks[Array]:
    """Slopes (n, k) of a hypothesis' residuals r by theta, from differences."""
    low, high = h.bounds()
    steps = np.where(h.theta + options.stride <= high, options.stride, -options.stride)
    steps = np.where(h.theta + steps < low, 0.5 * (high - low), steps)
    if not len(steps):
        return np.empty((len(r), 0))
    left = yield [h.at(h.theta + by) for by in np.diag(steps)]
    return np.column_stack([(moved - r) / by for moved, by in zip(left, steps)])


def drop_effects(f: Fitted, gone: object) -> tuple[Hypothesis, Array]:
    """A fit's hypothesis without some effects, and its slopes without theirs."""
    keep = list(range(len(f.hypothesis.numbers)))
    for c, s in zip(f.hypothesis.effects, f.hypothesis.slices()):
        keep += [] if gone(c) else list(range(s.start, s.stop))  # type: ignore[operator]
    return f.hypothesis.without(gone), f.J[:, keep]


def _prior_slopes(prior: Prior, theta: Array) -> Array:
    step = 1e-4
    return np.diag((prior.rows(theta + step) - prior.rows(theta - step)) / (2 * step))


def side_by_side(parts: Sequence[Asks[Any]]) -> Asks[list[Any]]:
    """Several fits of a region side by side, as one."""
    done: dict[int, Any] = {}
    wants: dict[int, list[Hypothesis]] = {}

    def advance(k: int, sent: list[Array] | None) -> None:
        try:
            wants[k] = next(parts[k]) if sent is None else parts[k].send(sent)
        except StopIteration as end:
            wants.pop(k, None)
            done[k] = end.value

    for k in range(len(parts)):
        advance(k, None)
    while wants:
        answers = iter((yield [h for wanted in wants.values() for h in wanted]))
        for k, wanted in list(wants.items()):
            advance(k, [next(answers) for _ in wanted])
    return [done[k] for k in range(len(parts))]
