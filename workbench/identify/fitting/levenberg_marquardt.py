"""Levenberg-Marquardt in lockstep: many small fits whose rollouts share one batch.

A fit is a generator that yields the points to be evaluated and is sent their residuals. Its parameters fall into independent
blocks (one joint each), so that one rollout moves all blocks at once.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field

import numpy as np

from workbench.identify.options import FIT
from workbench.types import Array

Point = list[Array]
"""Sizes, by block."""
Left = list[Array]
"""Residual vectors, by block."""
Asks = Generator[list[Point], list[Left], "list[Solved]"]


@dataclass(frozen=True)
class Solved:
    """Result of one block. x: sizes; r: their residuals; J: derivative of r by x, there or a step before; damping: of the next
    step; missed: whether a step from measured slopes brought no improvement."""

    x: Array
    r: Array
    J: Array
    damping: float = 1e-3
    missed: bool = False

    @property
    def cost(self) -> float:
        """Sum of squared residuals."""
        return float(self.r @ self.r)


def fit_blocks(
    start: Point,
    left: Left,
    bounds: Sequence[tuple[Array, Array]],
    iterations: int,
    stride: float | Array = FIT.stride_fixed,
    since: Sequence[Solved] = (),
    magnitudes: Array | None = None,
) -> Asks:
    """Fits every block from `start`, whose residuals are `left`. Jacobians by one difference per parameter, of a share `stride`
    of it (for a lone block, one share per parameter), then by Broyden's rule (C. G. Broyden, Math. Comp. 19, 1965: secants for
    one parameter). Small changes of a walk are mostly noise: there strides are long (WALKING). magnitudes: of a lone block, the
    least values to which the shares apply. since: fits that ended at `start`, and continue."""
    rough = bool(np.any(np.asarray(stride) != FIT.stride_fixed))
    blocks = [_Block(np.clip(np.asarray(s, dtype=float), *ends), r, *ends, rough) for s, r, ends in zip(start, left, bounds)]
    for b, s in zip(blocks, since):
        b.J, b.updated, b.damping, b.missed = s.J, True, s.damping, s.missed
    for _ in range(iterations):
        if not any(b.open for b in blocks):
            break
        stale = [b for b in blocks if b.open and not b.updated]
        if stale:
            for b in stale:
                b.steps = steps_of(b.x, b.low, b.high, stride, magnitudes)
            points = [[b.shift(i) if b in stale else b.x for b in blocks] for i in range(max(len(b.x) for b in stale))]
            for i, answer in enumerate((yield points)):
                for b, r in zip(blocks, answer):
                    if b in stale:
                        b.differ(i, r)
        trials = [list(pair) for pair in zip(*(b.trials() for b in blocks))]
        answers = yield trials
        for k, b in enumerate(blocks):
            if b.open:
                b.take([(t[k], a[k]) for t, a in zip(trials, answers)])
    return [Solved(b.x, b.r, b.J, b.damping, b.missed) for b in blocks]


@dataclass(eq=False)
class _Block:
    """State of one block: x, its residuals and the slopes J there; updated: by Broyden's rule, since they were measured.
    rough: slopes may be noise. missed: a step from measured slopes brought no improvement. steps: by which parameters are changed
    for slopes, and differences, the response to each. known: sizes tried so far and their cost."""

    x: Array
    r: Array
    low: Array
    high: Array
    rough: bool
    J: Array = field(init=False)
    updated: bool = False
    damping: float = 1e-3
    missed: bool = False
    open: bool = field(init=False)
    known: list[tuple[Array, float]] = field(init=False)
    steps: Array = field(init=False)
    differences: list[tuple[Array, Array]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.J = np.zeros((len(self.r), len(self.x)))
        self.open = len(self.x) > 0
        self.steps = np.zeros(len(self.x))
        self.known = [(self.x, float(self.r @ self.r))]

    def shift(self, i: int) -> Array:
        """Sizes with number i moved for a difference; as they are where there is no such number."""
        return self.x + np.eye(len(self.x))[i] * self.steps[i] if i < len(self.x) else self.x

    def differ(self, i: int, r: Array) -> None:
        """Slope i, from the residuals where parameter i had changed."""
        if i < len(self.x):
            self.J[:, i] = (r - self.r) / self.steps[i]
            self.differences.append((self.shift(i), r))

    def trials(self) -> tuple[Array, ...]:
        """The next points: a damped step, and on a walk also a short one. Where steps brought no improvement, slopes were noise:
        a lone parameter is evaluated far on both sides, and the minimum of the parabola through these values replaces the short
        step."""
        if not self.rough:
            return (_step(self.x, self.r, self.J, self.damping, self.low, self.high) if self.open else self.x,)
        if not self.open:
            return self.x, self.x
        if self.missed and self._near_sighted:
            return np.clip(self.x * (1 + FIT.wide), self.low, self.high), np.clip(self.x / (1 + FIT.wide), self.low, self.high)
        first, second = (_step(self.x, self.r, self.J, self.damping * k + extra, self.low, self.high)
                         for k, extra in ((1, 0.0), (30, 0.3)))
        bottom = lowest(self.known, self.low, self.high) if self.missed else None
        return first, second if bottom is None else bottom

    @property
    def _near_sighted(self) -> bool:
        """Whether a walk's slopes may be noise and all that was seen of the one number lies close."""
        return self.rough and len(self.x) == 1 and bool(np.ptp([at[0] for at, _ in self.known]) < FIT.wide * abs(self.x[0]))

    def take(self, answers: Sequence[tuple[Array, Array]]) -> None:
        """Moves to the best point tried; if none is better, tries again: from new differences where slopes were updated, or with
        a short step."""
        tried = [*answers, *self.differences]
        self.differences = []
        costs = [float(r @ r) for _, r in tried]
        self.known += [(at, cost) for (at, _), cost in zip(tried, costs)]
        best, before = int(np.argmin(costs)), float(self.r @ self.r)
        if not costs[best] < before:
            self.open, self.missed = self.updated or not self.missed, self.missed or not self.updated
            self.updated = not self.updated
            self.damping *= 1e3 if self.updated else 1.0
            return
        there, left_there = tried[best]
        way = there - self.x
        if way @ way > FIT.tiny**2:
            self.J = self.J + np.outer(left_there - self.r - self.J @ way, way) / (way @ way)
        settled = before - costs[best] <= FIT.converged * before
        self.updated, self.missed = True, settled and self._near_sighted
        self.open = self.missed or not settled
        self.damping = self.damping / 3 if best == 0 else min(self.damping * 10, 1.0)
        self.x, self.r = there, left_there


def steps_of(x: Array, low: Array, high: Array, stride: float | Array, magnitudes: Array | None = None) -> Array:
    """Change of each parameter for a difference: a share `stride` of it, or of `magnitudes`, within its bounds."""
    step = stride * np.maximum(np.abs(x), FIT.least_move if magnitudes is None else magnitudes)
    return np.asarray(np.where(x + step <= high, step, -step))


def lowest(seen: Sequence[tuple[Array, float]], low: Array, high: Array) -> Array | None:
    """The size of one number at which the parabola through the three best sizes seen is lowest; None where it is not, or not
    known."""
    if len(low) != 1:
        return None
    best = sorted({float(at[0]): cost for at, cost in seen}.items(), key=lambda p: p[1])[:3]
    if len(best) < 3:
        return None
    at = np.array([p[0] for p in best])
    bend, slope, _ = np.polyfit(at, [p[1] for p in best], 2)
    if not bend > 0:
        return None
    return np.clip([np.clip(-slope / (2 * bend), at.min(), at.max())], low, high)


def _step(x: Array, r: Array, J: Array, damping: float, low: Array, high: Array) -> Array:
    """A damped Gauss-Newton step that stays within bounds; numbers at a bound that they would leave wait."""
    g = J.T @ r
    free = ~(((x <= low) & (g > 0)) | ((x >= high) & (g < 0)))
    if not free.any():
        return x
    H = J[:, free].T @ J[:, free]
    move = np.zeros(len(x))
    move[free] = -np.linalg.lstsq(H + damping * np.diag(np.maximum(np.diag(H), 1e-9)), g[free], rcond=None)[0]
    return np.asarray(np.clip(x + move, low, high))
