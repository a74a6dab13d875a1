"""Many fits at once: robust least squares by Levenberg and Marquardt, all Jacobians and trial steps in one vectorised rollout."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.types import Array

SIGMA = 0.02
"""Error [rad] beyond which a row counts by its size, no longer by its square: what stick and slip leave, 13 ticks; a fit by the
sensor's own 0.0015 rad would follow a few rows in which the arm happened to stick."""
EVERY = 4
"""Of the rows of a rollout, one in so many is fitted."""
DAMPINGS = (0.1, 1.0, 30.0)
ITERATIONS = 14
Rollout = Callable[[Mapping[str, Array]], Array]
"""Positions (T, P, L) of P parameter sets, values (P,) by name."""


@dataclass(frozen=True)
class Number:
    """One number of a fit, with the bounds that it may take; size: a change of it that is felt."""

    name: str
    start: float
    low: float
    high: float
    size: float


@dataclass(frozen=True)
class Problem:
    """A fit: its numbers, and the logs (L,) that it sees."""

    numbers: tuple[Number, ...]
    logs: NDArray[np.bool_]


@dataclass(frozen=True)
class Fitted:
    """values by name, and the robust cost that they leave on the logs of the fit."""

    values: dict[str, float]
    cost: float


def fit_all(problems: Sequence[Problem], rollout: Rollout, position: Array, neutral: Mapping[str, float],
            iterations: int = ITERATIONS) -> list[Fitted]:
    """Fits each problem to the positions (T, L) [rad] of its logs. neutral: value of a parameter that a problem does not have."""
    names = tuple(dict.fromkeys([n.name for p in problems for n in p.numbers]))

    def residuals(sets: Sequence[tuple[int, Array]]) -> list[Array]:
        """Residuals over SIGMA of parameter sets, each of a problem (by index)."""
        values = {name: np.full(len(sets), neutral.get(name, 0.0)) for name in names}
        for row, (i, x) in enumerate(sets):
            for number, value in zip(problems[i].numbers, x):
                values[number.name][row] = value
        left = np.nan_to_num(rollout(values) - position[:, None])[::EVERY] / SIGMA
        left = np.broadcast_to(left, (len(left), len(sets), left.shape[2]))  # without any number all sets are one
        return [left[:, row][:, problems[i].logs].ravel() for row, (i, _) in enumerate(sets)]

    fits = [_Fit(p) for p in problems]
    for fit, r in zip(fits, residuals([(i, f.x) for i, f in enumerate(fits)])):
        fit.begin(r)
    for _ in range(iterations):
        open_ = [i for i, f in enumerate(fits) if not f.done]
        if not open_:
            break
        moved = iter(residuals([(i, x) for i in open_ for x in fits[i].moves()]))
        for i in open_:
            fits[i].linearise([next(moved) for _ in fits[i].x])
        trials = {i: fits[i].trials() for i in open_}
        tried = iter(residuals([(i, x) for i in open_ for x in trials[i]]))
        for i in open_:
            fits[i].choose(trials[i], [next(tried) for _ in trials[i]])
    return [Fitted({n.name: float(x) for n, x in zip(f.problem.numbers, f.x)}, f.cost) for f in fits]


def robust_cost(r: Array) -> float:
    """Half the squares of small residuals, the size of large ones."""
    return float((np.sqrt(1 + np.square(r)) - 1).sum())


class _Fit:
    """One problem on its way."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        low, high, size = (np.array([getattr(n, f) for n in problem.numbers]) for f in ("low", "high", "size"))
        self.low, self.high, self.size = low, high, size
        self.x = np.clip(np.array([n.start for n in problem.numbers]), low, high)
        self.damping, self.done = 0.01, not len(self.x)

    def begin(self, r: Array) -> None:
        self.r, self.cost = r, robust_cost(r)

    def moves(self) -> list[Array]:
        """Sets in which one number each is moved a little, away from its bound."""
        self.step = np.where(self.x + 0.03 * self.size <= self.high, 0.03 * self.size, -0.03 * self.size)
        return [self.x + move for move in np.diag(self.step)]

    def linearise(self, moved: Sequence[Array]) -> None:
        weight = 1 / np.sqrt(1 + np.square(self.r))
        J = np.stack([(m - self.r) / s for m, s in zip(moved, self.step)], axis=1) * self.size
        self.H, self.g = J.T @ (J * weight[:, None]), J.T @ (self.r * weight)

    def trials(self) -> list[Array]:
        """Steps at three dampings, in the numbers that are not pressed against a bound."""
        free = ~(((self.x <= self.low) & (self.g > 0)) | ((self.x >= self.high) & (self.g < 0)))
        out = []
        for scale in DAMPINGS:
            x = self.x.copy()
            H = self.H[np.ix_(free, free)]
            H = H + self.damping * scale * np.diag(np.maximum(np.diag(H), 1e-9))
            x[free] -= self.size[free] * np.linalg.lstsq(H, self.g[free], rcond=None)[0]
            out.append(np.clip(x, self.low, self.high))
        return out

    def choose(self, trials: Sequence[Array], tried: Sequence[Array]) -> None:
        costs = [robust_cost(r) for r in tried]
        best = int(np.argmin(costs))
        if costs[best] >= self.cost:
            self.damping *= 100
            self.done = self.damping > 1e5
            return
        self.done = costs[best] > (1 - 5e-4) * self.cost
        self.x, self.r, self.cost = trials[best], tried[best], costs[best]
        self.damping = max(self.damping * DAMPINGS[best], 1e-4)
