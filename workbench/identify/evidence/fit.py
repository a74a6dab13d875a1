"""A hypothesis fitted, with its evidence; fits ask for rollouts as generators, so that many share one batch."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import hadamard

from workbench.identify.evidence.hypothesis import Hypothesis, Prior, log_odds
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.region import Region
from workbench.identify.fitting.levenberg_marquardt import Solved, fit_blocks, steps_of

Array = NDArray[np.float64]
T = TypeVar("T")
Asks = Generator[list[Hypothesis], list[Array], T]
"""Yields hypotheses to be rolled out, is sent the residuals (n,) [rad] that each leaves."""


@dataclass(frozen=True)
class Fitted:
    """r (n,): what it leaves [rad]; J (n, k): of r by theta; discrepancy [rad]; log_evidence [nats]; log_prior [nats]: of which
    effects there are; too_much (k, k): information that J seems to hold and that is only noise of J, where that is known."""

    hypothesis: Hypothesis
    r: Array = field(repr=False)
    J: Array = field(repr=False)
    discrepancy: float
    log_evidence: float
    log_prior: float
    too_much: Array | None = field(default=None, repr=False)

    @property
    def log_posterior(self) -> float:
        """But for a constant [nats]."""
        return self.log_evidence + self.log_prior

    def covariance(self, region: Region, options: EvidenceOptions) -> Array:
        """Of theta (k, k)."""
        h, likelihood = self.hypothesis, region.likelihood
        H = (self.J.T * likelihood.precision(self.r, self.discrepancy)) @ self.J
        if self.too_much is not None:
            told, axes = np.linalg.eigh(H - self.too_much)
            H = (axes * np.maximum(told, 0.0)) @ axes.T
        return np.asarray(np.linalg.inv(H + np.diag(Prior.of(h, options).precision(h.theta))))


def judged(region: Region, options: EvidenceOptions, h: Hypothesis, r: Array, J: Array) -> Fitted:
    """A hypothesis with its evidence, where it stands."""
    prior = Prior.of(h, options)
    log, s = region.likelihood.evidence(r, J, prior.log(h.theta), prior.precision(h.theta))
    parts = len(h.effects) + sum(len(c.options) for c in h.effects)
    return Fitted(h, r, J, s, log, parts * log_odds(len(region.candidates), options.expected))


def fitting(region: Region, options: EvidenceOptions, start: Hypothesis, s: float, iterations: int, r: Array | None = None,
            J: Array | None = None) -> Asks[Fitted]:
    """Fits a hypothesis from where it stands, at a discrepancy s. r: what it leaves there, where known; J: slopes of that, NaN in
    columns that are not known: these are measured by differences."""
    prior, (low, high) = Prior.of(start, options), start.bounds()
    start = start.at(np.clip(start.theta, low, high))
    if r is None:
        (r,) = yield [start]
    J = yield from _measured(start, r, J, options.stride)
    seen = [(start.theta, r)]

    def rows(theta: Array, left: Array) -> Array:
        return np.concatenate([region.likelihood.rows(left, s), prior.rows(theta)])

    first = rows(start.theta, r)
    slopes = np.vstack([region.likelihood.slope(r, s)[:, None] * J, _prior_slopes(prior, start.theta)])
    fit = fit_blocks([start.theta], [first], [(low, high)], iterations, options.stride, [Solved(start.theta, first, slopes)],
                     np.ones(len(start.theta)))
    try:
        points = next(fit)
        while True:
            answers = yield [start.at(p[0]) for p in points]
            seen += [(p[0], left) for p, left in zip(points, answers)]
            points = fit.send([[rows(p[0], left)] for p, left in zip(points, answers)])
    except StopIteration:
        theta, left, J = _followed(seen, J, lambda theta, left: float(np.sum(np.square(rows(theta, left)))))
    return judged(region, options, start.at(theta), left, J)


def _measured(h: Hypothesis, r: Array, J: Array | None, stride: float) -> Asks[Array]:
    """Slopes (n, k) of r, those that are not known by differences."""
    k = len(h.theta)
    J = np.full((len(r), k), np.nan) if J is None else J.copy()
    unknown = np.flatnonzero(np.isnan(J).any(axis=0))
    if len(unknown):
        steps = steps_of(h.theta, *h.bounds(), stride, np.ones(k))
        left = yield [h.at(h.theta + np.eye(k)[i] * steps[i]) for i in unknown]
        J[:, unknown] = np.column_stack([(x - r) / steps[i] for i, x in zip(unknown, left)])
    return J


def _followed(seen: Sequence[tuple[Array, Array]], J: Array, cost: Callable[[Array, Array], float]) -> tuple[Array, Array, Array]:
    """Of what a fit saw (theta, r), in its order: the best, what that leaves, and its slopes, from those at the first, J, by
    differences where one number moved and by Broyden's rule where the fit went on."""
    (at, r), *others = seen
    J, least = J.copy(), cost(at, r)
    for theta, left in others:
        way, better = theta - at, cost(theta, left) < least
        if np.count_nonzero(way) == 1:
            k = int(np.flatnonzero(way)[0])
            J[:, k] = (left - r) / way[k]
        elif better and way.any():
            J += np.outer(left - r - J @ way, way) / (way @ way)
        if better:
            at, r, least = theta, left, cost(theta, left)
    return at, r, J


def polished(region: Region, options: EvidenceOptions, f: Fitted) -> Asks[Fitted]:
    """A fit gone on with at its own discrepancy by slopes that are regressed, over moves that get shorter: joints that stick make
    a landscape of many small valleys, in which differences lead astray."""
    s, spread = f.discrepancy, options.spread
    while spread >= options.stride:
        moves = yield from _moves(f.hypothesis, spread)
        prior = Prior.of(f.hypothesis, options)
        costs = [np.sum(np.square(region.likelihood.rows(left, s))) + np.sum(np.square(prior.rows(h.theta)))
                 for h, left in moves.seen]
        h, left = moves.seen[int(np.argmin(costs))]
        here = float(np.sum(np.square(region.likelihood.rows(f.r, s))) + np.sum(np.square(prior.rows(f.hypothesis.theta))))
        h, left = (h, left) if min(costs) < here else (f.hypothesis, f.r)
        on = yield from fitting(region, options, h, s, 1, left, moves.slopes[0])
        f, spread = max(f, on, key=lambda g: g.log_posterior), spread / 2
    return f


def regressed(region: Region, options: EvidenceOptions, f: Fitted) -> Asks[Fitted]:
    """A fit with slopes J by regression on moves of all its numbers at once, as far as `options.spread`.

    A joint that sticks answers a small move by chance, which differences of one number after the other take for slopes, and
    their square for information: two numbers that do the same would seem to be told apart, and both to be well known. What the
    moves leave unexplained says how much of it is chance, which is taken off (W. Fuller, Measurement error models, 1987).
    """
    moves = yield from _moves(f.hypothesis, options.spread, 4)
    J, chance, scatter = moves.slopes
    precision = region.likelihood.precision(f.r, f.discrepancy)
    return replace(f, J=J, too_much=float(precision @ chance) * scatter)


@dataclass(frozen=True)
class _Moves:
    """Hypotheses with what they leave: m that were moved one way, then the same moved back."""

    seen: list[tuple[Hypothesis, Array]]

    @property
    def slopes(self) -> tuple[Array, Array, Array]:
        """Slopes (n, k) of what is left; the variance (n,) of what they do not explain; of the slopes by that (k, k)."""
        m = len(self.seen) // 2
        theta, left = np.array([h.theta for h, _ in self.seen]), np.array([r for _, r in self.seen])
        moved, answer = theta[:m] - theta[m:], left[:m] - left[m:]
        J = np.asarray(np.linalg.lstsq(moved, answer, rcond=None)[0].T, dtype=float)
        chance = np.square(answer - moved @ J.T).sum(axis=0) / max(m - moved.shape[1], 1)
        return J, chance, np.asarray(np.linalg.pinv(moved.T @ moved), dtype=float)


def _moves(h: Hypothesis, spread: float, to_a_number: int = 1) -> Asks[_Moves]:
    """All numbers moved at once, forth and back: signs of a Hadamard matrix, so that all moves tell each number (R. Plackett and
    J. Burman, Biometrika 33, 1946), at least so many pairs to a number."""
    k = len(h.theta)
    signs = hadamard(1 << (to_a_number * k).bit_length())[:, 1:k + 1]
    moves = spread * np.linspace(0.5, 1.5, len(signs))[:, None] * signs  # each a different one, however few numbers
    wanted = [h.at(np.clip(h.theta + move, *h.bounds())) for move in (*moves, *-moves)]
    left = yield wanted
    return _Moves(list(zip(wanted, left)))


def without(f: Fitted, gone: object) -> tuple[Hypothesis, Array]:
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
