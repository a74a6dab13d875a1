"""The likelihood of a model's residuals, and its evidence: the only criterion of the search.

    r ~ t(0, sqrt(noise^2 + numerics^2 + s^2)),  each frame counting frame time / (2 tau)

r: recorded less simulated angles of one joint. noise: of the recording; numerics: uncertainty from the simulation's step; s:
the model's own discrepancy (M. Kennedy and A. O'Hagan, J. R. Stat. Soc. B 63, 2001), estimated for each model by its evidence,
so that a model with smaller residuals has sharper parameters. tau: measured correlation time of the residuals, since the errors
of neighbouring frames are correlated; a log of a minute holds some hundred independent samples, not ten thousand. The tails are
Student's, as stick and slip are events.

log evidence = max over s of  log p(r | theta, s) + log p(theta) + k/2 log 2 pi - 1/2 log |H|         (Laplace, at the fitted
theta)

R. Kass and A. Raftery, JASA 90, 1995.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import gammaln

from workbench.identify.evidence.options import NUMERICS
from workbench.types import Array


@dataclass(frozen=True)
class Likelihood:
    """Likelihood of residuals (n,) [rad]. known (n,): noise and numerics together [rad]; span (n,): time per frame [s];
    tau: correlation time [s]; tails: degrees of freedom; between: least and most discrepancy [rad]."""

    known: Array
    span: Array
    tau: float
    tails: float
    between: tuple[float, float]

    @cached_property
    def counts(self) -> Array:
        """Number of independent samples that each frame counts as (n,), at most one."""
        return np.asarray(np.minimum(self.span / (2.0 * self.tau), 1.0))

    def scale(self, s: float) -> Array:
        """Scale of the residuals (n,) [rad], at a discrepancy s."""
        return np.asarray(np.hypot(self.known, s))

    def log(self, r: Array, s: float) -> float:
        """Log likelihood [nats]."""
        nu, scale = self.tails, self.scale(s)
        each = self._at_zero - np.log(scale) - (nu + 1) / 2 * np.log1p(np.square(r / scale) / nu)
        return float(self.counts @ each)

    @cached_property
    def _at_zero(self) -> float:
        """Log density of no residual at a scale of 1 rad [nats]."""
        nu = self.tails
        return float(gammaln((nu + 1) / 2) - gammaln(nu / 2) - 0.5 * np.log(nu * np.pi))

    def rows(self, r: Array, s: float) -> Array:
        """Numbers (n,) of which half the squares are the log likelihood but for a constant: what least squares fit."""
        nu = self.tails
        return np.asarray(np.copysign(np.sqrt(self.counts * (nu + 1) * np.log1p(np.square(r / self.scale(s)) / nu)), r))

    def slope(self, r: Array, s: float) -> Array:
        """Derivative of `rows` by r (n,)."""
        nu, scale = self.tails, self.scale(s)
        z = np.maximum(np.abs(r / scale), 1e-6)
        return np.asarray(np.sqrt(self.counts * (nu + 1)) * z / (nu + z * z) / np.sqrt(np.log1p(z * z / nu)) / scale)

    def precision(self, r: Array, s: float) -> Array:
        """How sharply each frame tells (n,) [1/rad^2], as iteratively reweighted least squares have it."""
        nu = self.tails
        return np.asarray(self.counts * (nu + 1) / (nu * np.square(self.scale(s)) + np.square(r)))

    def discrepancy(self, r: Array) -> float:
        """The likeliest size of the discrepancy [rad]."""
        return self._largest(lambda s: self.log(r, s))[1]

    def evidence(self, r: Array, J: Array, log_prior: float, prior_precision: Array) -> tuple[float, float]:
        """Log evidence [nats], and the discrepancy at which it is largest [rad]. J (n, k): of r by the model's numbers, there;
        log_prior: of the numbers; prior_precision (k,): its curvature."""
        def log(s: float) -> float:
            H = (J.T * self.precision(r, s)) @ J + np.diag(prior_precision)
            return self.log(r, s) + 0.5 * len(H) * float(np.log(2 * np.pi)) - 0.5 * float(np.linalg.slogdet(H)[1])

        found, s = self._largest(log)
        return found + log_prior, s

    def _largest(self, value: Callable[[float], float]) -> tuple[float, float]:
        """The most that a function of the discrepancy comes to, and where."""
        ends = (float(np.log(self.between[0])), float(np.log(self.between[1])))
        found = minimize_scalar(lambda x: -value(float(np.exp(x))), bounds=ends, method="bounded",
                                options={"xatol": NUMERICS.settled})
        return -float(found.fun), float(np.exp(found.x))


def correlation_time(parts: list[tuple[Array, float]]) -> float:
    """Integrated autocorrelation time [s] of residuals, of takes (values with NaN where unseen, time between frames [s])
    together: half the frame time where frames are independent. Summed until it is NUMERICS.window correlation times long (A.
    Sokal, Monte Carlo methods in statistical mechanics, 1997, section 3)."""
    frame = float(np.median([dt for _, dt in parts]))
    longest = max(len(x) for x, _ in parts)
    products, pairs = np.zeros(longest), np.zeros(longest)
    for x, _ in parts:
        seen = np.isfinite(x)
        products[:len(x)] += _autocorrelation(np.where(seen, x, 0.0))
        pairs[:len(x)] += _autocorrelation(seen.astype(float))
    rho = np.divide(products, pairs, out=np.zeros_like(products), where=pairs > 0.5)
    if rho[0] <= 0:
        return frame / 2
    tau = 0.5 + np.cumsum(rho[1:] / rho[0])
    ends = np.flatnonzero(np.arange(1, len(tau) + 1) >= NUMERICS.window * tau)
    return float(frame * max(0.5, tau[ends[0] if len(ends) else -1])) if len(tau) else frame / 2


def _autocorrelation(x: Array) -> Array:
    """Sums of products at each lag (N,)."""
    n = len(x)
    spectrum = np.fft.rfft(x, 2 * n)
    return np.asarray(np.fft.irfft(spectrum * np.conj(spectrum), 2 * n)[:n])
