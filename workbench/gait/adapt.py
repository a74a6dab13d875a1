"""A few trials choose a gait for a robot that has changed: predictions of a model, corrected by the trials' results."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.files import InputError
from workbench.files.option_checks import check_positive
from workbench.types import Array

LEAST = 1e-6
"""Scale of predictions that are all zero, so that trials still correct them."""


@dataclass(frozen=True)
class TrialOptions:
    """How trials correct predictions.

    reach: distance over which a trial corrects the predictions of similar gaits, as a share of the range of the gaits' numbers.
    wrong: standard deviation of a prediction, as a share of the largest one; a diagnosed puppy's speeds are 10 to 20 % off.
    scatter: standard deviation of a trial, likewise. curious: number of standard deviations by which an uncertain gait is
    favoured.
    """

    reach: float = 0.3
    wrong: float = 0.2
    scatter: float = 0.03
    curious: float = 0.5

    def __post_init__(self) -> None:
        check_positive(self, "reach", "wrong", "scatter")


class TrialChooser:
    """Which gait to try next, and which was best: a Gaussian process on the difference between trials and predictions.

    numbers: (N, d) of each gait, such as turn and pace. predicted: (N,) performance by the model, more is better, NaN where the
    model falls; such gaits are never tried. InputError where no gait remains.
    """

    def __init__(self, numbers: Array, predicted: Array, options: TrialOptions | None = None) -> None:
        self.options, self.predicted = options or TrialOptions(), np.asarray(predicted, dtype=float)
        if not np.isfinite(self.predicted).any():
            raise InputError(None, "the model falls with every gait; there is none to try")
        extent = np.ptp(numbers, axis=0)
        self._x = np.asarray(numbers, dtype=float) / np.where(extent > 0, extent, 1.0)
        self._scale = max(float(np.nanmax(np.abs(self.predicted))), LEAST)
        self.tried: dict[int, float] = {}

    @property
    def expected(self) -> tuple[Array, Array]:
        """Performance (N,) after the trials, and its standard deviation (N,)."""
        o, known = self.options, list(self.tried)
        prior = (o.wrong * self._scale) ** 2
        if not known:
            return self.predicted, np.full(len(self.predicted), np.sqrt(prior))
        K = prior * self._alike(self._x[known], self._x[known]) + (o.scatter * self._scale) ** 2 * np.eye(len(known))
        k = prior * self._alike(self._x, self._x[known])
        gain = np.linalg.solve(K, k.T).T
        wrong = np.array(list(self.tried.values())) - self.predicted[known]
        return self.predicted + gain @ wrong, np.sqrt(np.maximum(prior - (gain * k).sum(axis=1), 0.0))

    def next(self) -> int:
        """The most promising gait that has not been tried yet; a tried one where there is no other."""
        mean, sd = self.expected
        promise = np.where(np.isfinite(mean), mean + self.options.curious * sd, -np.inf)
        untried = np.isfinite(promise) & ~np.isin(np.arange(len(promise)), list(self.tried))
        return int(np.argmax(np.where(untried, promise, -np.inf) if untried.any() else promise))

    def tell(self, which: int, performance: float) -> None:
        """The performance of a trial; 0 for a fall."""
        self.tried[which] = performance

    @property
    def best(self) -> int:
        """The gait with the best trial. InputError before the first one."""
        if not self.tried:
            raise InputError(None, "expected at least one trial")
        return max(self.tried, key=lambda k: self.tried[k])

    def _alike(self, a: Array, b: Array) -> Array:
        apart = ((a[:, None] - b[None]) ** 2).sum(axis=2)
        return np.asarray(np.exp(-apart / (2 * self.options.reach**2)))
