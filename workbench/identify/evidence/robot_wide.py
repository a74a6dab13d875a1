"""Effects of the whole robot beside those of its joints, in logs of several joints: each joint is a region of its own, and what
acts in all of them is judged by what all gain together.

With the joints' numbers theta_j and the shared ones g, the information matrix has the form of an arrow, so that

    log evidence = sum over joints of log evidence(theta_j | g) + log p(g) + k/2 log 2 pi - 1/2 log |S|,
    S = H_gg - sum of H_gj H_jj^-1 H_jg                                                       (Schur complement of the joints)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from workbench.identify.evidence.fit import Fitted, evaluate
from workbench.identify.evidence.hypothesis import Hypothesis, Prior, log_odds
from workbench.identify.evidence.linearise import Probe, led_after, on_lines, points, ways
from workbench.identify.evidence.options import NUMERICS, EvidenceOptions
from workbench.identify.evidence.region import Region
from workbench.identify.parameters import Candidate
from workbench.types import Array

if TYPE_CHECKING:
    from workbench.identify.evidence.rollouts import Rollouts


@dataclass(frozen=True)
class Together:
    """Fits of every region. shared: effects of the whole robot; fits: by region, with these; slopes (n, k): by region, of
    its residuals by the shared parameters; covariance (k, k) of these; log_posterior [nats] of the whole."""

    shared: Hypothesis
    fits: tuple[Fitted, ...]
    slopes: tuple[Array, ...] = field(repr=False)
    covariance: Array = field(repr=False)
    log_posterior: float


class _Blocks(NamedTuple):
    """The information that one region brings, in blocks. own (k, k): of its numbers, with their prior; mixed (k, m): of these and
    the shared ones; shared (m, m): of the shared ones, less what its own numbers take (Schur complement); precision (n,): of each
    frame [1/rad^2]."""

    own: Array
    mixed: Array
    shared: Array
    precision: Array


@dataclass(frozen=True)
class Whole:
    """Judges regions together. names: effects of the whole robot that could be there."""

    rollouts: Rollouts
    names: tuple[Candidate, ...]
    options: EvidenceOptions

    @property
    def regions(self) -> tuple[Region, ...]:
        """The robot's regions."""
        return self.rollouts.regions

    def start(self, fits: Sequence[Fitted]) -> Together:
        """Regions with shared effects whose slopes are not known yet."""
        shared = self.rollouts.shared
        return self.evaluate(shared, fits, [np.zeros((len(f.r), len(shared.theta))) for f in fits])

    def evaluate(self, shared: Hypothesis, fits: Sequence[Fitted], slopes: Sequence[Array]) -> Together:
        """The regions and their shared effects, at the current parameters."""
        prior = Prior.of(shared, self.options)
        S = np.diag(prior.precision(shared.theta))
        for region, f, G in zip(self.regions, fits, slopes):
            S = S + self._blocks(region, f, G).shared
        names = len(self.names) + max(len(r.candidates) for r in self.regions)
        price = len(shared.effects) * log_odds(names, self.options.expected)
        laplace = 0.5 * len(S) * float(np.log(2 * np.pi)) - 0.5 * float(np.linalg.slogdet(S)[1])
        total = sum(f.log_posterior for f in fits) + prior.log(shared.theta) + laplace + price
        return Together(shared, tuple(fits), tuple(slopes), np.asarray(np.linalg.inv(S), dtype=float), total)

    def predict(self, at: Together) -> Together | None:
        """The best effect more of the whole robot, by lines through rollouts; None where there is none to be added."""
        there = {c.key for c in at.shared.effects}
        asked = [(c, x, k) for c in self.names if c.key not in there for x, k in points(c, at.shared)]
        if not asked:
            return None
        each = [f.hypothesis for f in at.fits]
        left = self.rollouts.everywhere([(at.shared.with_effect(c, x), each) for c, x, _ in asked])
        probes = [Probe(c, x, k, np.concatenate(r)) for (c, x, k), r in zip(asked, left)]
        none = np.concatenate([f.r for f in at.fits])
        return max((self._best_along(at, none, along) for along in ways(probes)), key=lambda t: t.log_posterior)

    def _best_along(self, at: Together, none: Array, along: Sequence[Probe]) -> Together:
        c, k, best = along[0].candidate, along[0].moved, (-np.inf, at)
        ends = np.cumsum([len(f.r) for f in at.fits])[:-1]
        for x, r in on_lines(none, along):
            shared = at.shared.with_effect(c, x)
            led = [led_after(region, self.options, f, f.hypothesis, part, f.J, np.ones(len(f.hypothesis.theta), bool))
                   for region, f, part in zip(self.regions, at.fits, np.split(r, ends))]
            value = self._objective(at, shared, [h for h, _, _ in led], [part for _, part, _ in led])
            if value > best[0]:
                column = (r - none) / (x[k] if k >= 0 and abs(x[k]) > 1e-6 else 1.0)
                best = (value, self._move(at, shared, [(h, part) for h, part, _ in led], k, np.split(column, ends)))
        return best[1]

    def _move(self, at: Together, shared: Hypothesis, led: Sequence[tuple[Hypothesis, Array]], k: int, columns: Sequence[Array]
              ) -> Together:
        """The regions with one more effect, which does what `columns` say by its number k."""
        fits = [evaluate(region, self.options, h, r, f.J) for region, f, (h, r) in zip(self.regions, at.fits, led)]
        own, slopes = shared.slices()[-1], []
        for G, column in zip(at.slopes, columns):
            more = np.zeros((len(column), own.stop - own.start))
            if more.shape[1]:
                more[:, max(k, 0)] = column
            slopes.append(np.hstack([G, more]))
        return self.evaluate(shared, fits, slopes)

    def fit(self, at: Together) -> Together:
        """Fits all numbers at once, with slopes by differences; those of the regions' own numbers are measured once."""
        at = self._measure_slopes(at)
        at = self._rolled_out(at, at.shared, [f.hypothesis for f in at.fits], [f.r for f in at.fits])
        for _ in range(self.options.iterations):
            tried = [self._step(at, share) for share in NUMERICS.shares]
            answers = self.rollouts.everywhere(tried)
            now = self._objective(at, at.shared, [f.hypothesis for f in at.fits], [f.r for f in at.fits])
            values = [self._objective(at, shared, each, r) for (shared, each), r in zip(tried, answers)]
            best = int(np.argmax(values))
            if values[best] < now + NUMERICS.gain:
                break
            at = self._rolled_out(at, *tried[best], answers[best])
        return at

    def _measure_slopes(self, at: Together) -> Together:
        """Measures the slopes of the regions' own numbers at the current parameters: one number of each region at a time."""
        each, stride = [f.hypothesis for f in at.fits], self.options.stride
        steps = [np.where(h.theta + stride <= h.bounds()[1], stride, -stride) for h in each]
        most = max(len(h.theta) for h in each)
        moved = [[h.at(h.theta + step * (np.arange(len(step)) == i)) for h, step in zip(each, steps)] for i in range(most)]
        there, *left = self.rollouts.everywhere([(at.shared, hypotheses) for hypotheses in (each, *moved)])
        slopes = [np.reshape([(left[i][k] - r) / step[i] for i in range(len(step))], (len(step), len(r))).T
                  for k, (r, step) in enumerate(zip(there, steps))]
        fits = [evaluate(region, self.options, f.hypothesis, r, J)
                for region, f, r, J in zip(self.regions, at.fits, there, slopes)]
        return self.evaluate(at.shared, fits, at.slopes)

    def _rolled_out(self, at: Together, shared: Hypothesis, each: Sequence[Hypothesis], left: Sequence[Array]) -> Together:
        """Evaluates the current parameters by rollouts, and measures the slopes of the shared numbers there."""
        _, high = shared.bounds()
        ways = np.where(shared.theta + self.options.stride <= high, self.options.stride, -self.options.stride)
        moved = self.rollouts.everywhere([(shared.at(shared.theta + m), each) for m in np.diag(ways)])
        slopes = [np.reshape([(m[j] - r) / by for m, by in zip(moved, ways)], (len(ways), len(r))).T for j, r in enumerate(left)]
        fits = [evaluate(region, self.options, h, r, f.J) for region, f, h, r in zip(self.regions, at.fits, each, left)]
        return self.evaluate(shared, fits, slopes)

    def _step(self, at: Together, share: float) -> tuple[Hypothesis, list[Hypothesis]]:
        """A share of the joint Gauss-Newton step."""
        prior = Prior.of(at.shared, self.options)
        P = prior.precision(at.shared.theta)
        S, b, parts = np.diag(P), P * (at.shared.theta - prior.center), []
        for region, f, G in zip(self.regions, at.fits, at.slopes):
            H, C, schur, precision = self._blocks(region, f, G)
            own = Prior.of(f.hypothesis, self.options)
            gradient = f.J.T @ (precision * f.r) + own.precision(f.hypothesis.theta) * (f.hypothesis.theta - own.center)
            S = S + schur
            b = b + G.T @ (precision * f.r) - C.T @ np.linalg.solve(H, gradient)
            parts.append((H, C, gradient))
        by = np.asarray(-np.linalg.solve(S, b), dtype=float)
        each = [_within(f.hypothesis, np.asarray(-share * np.linalg.solve(H, gradient + C @ by), dtype=float))
                for f, (H, C, gradient) in zip(at.fits, parts)]
        return _within(at.shared, share * by), each

    def _blocks(self, region: Region, f: Fitted, G: Array) -> _Blocks:
        precision = region.likelihood.precision(f.r, f.discrepancy)
        prior = Prior.of(f.hypothesis, self.options).precision(f.hypothesis.theta)
        H, C = (f.J.T * precision) @ f.J + np.diag(prior), (f.J.T * precision) @ G
        return _Blocks(H, C, (G.T * precision) @ G - C.T @ np.linalg.solve(H, C), precision)

    def _objective(self, at: Together, shared: Hypothesis, each: Sequence[Hypothesis], left: Sequence[Array]) -> float:
        """Log likelihood and prior [nats] at the discrepancies of `at`."""
        parts = (region.likelihood.log(r, f.discrepancy) + Prior.of(h, self.options).log(h.theta)
                 for region, f, h, r in zip(self.regions, at.fits, each, left))
        return sum(parts) + Prior.of(shared, self.options).log(shared.theta)


def _within(h: Hypothesis, by: Array) -> Hypothesis:
    """A hypothesis with its numbers moved, within their bounds."""
    return h.at(np.clip(h.theta + by, *h.bounds()))
