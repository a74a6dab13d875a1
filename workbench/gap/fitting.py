"""Levenberg-Marquardt in lockstep: many small fits whose rollouts share one batch.

A fit is a generator that yields the points it wants evaluated and is sent what they leave. Its numbers fall into blocks that
do not feel each other (one joint each), so that one rollout moves all blocks at once.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Point = list[Array]
"""Sizes, by block."""
Left = list[Array]
"""Residual vectors, by block."""
Asks = Generator[list[Point], list[Left], "list[Solved]"]
T = TypeVar("T")
HELD, WALKING, NEAR = 0.15, 0.4, 0.08
"""Share of a number by which it is moved for a difference: where the base is held, on a walk, and there near the end."""
TINY = 1e-6
"""Of a number, below which a move tells nothing of slopes."""
SETTLED = 3e-3
"""A fit ends where a step takes less than this share off the sum of squares."""


@dataclass(frozen=True)
class Solved:
    """One block's end. x: sizes; r: what they leave; J: of r with respect to x, there or a step before."""

    x: Array
    r: Array
    J: Array

    @property
    def cost(self) -> float:
        return float(self.r @ self.r)


def fit_blocks(start: Point, left: Left, bounds: Sequence[tuple[Array, Array]], iterations: int, stride: float | Array = HELD,
               slopes: Sequence[Array] | None = None) -> Asks:
    """Fits every block from `start`, which leaves `left`. Jacobians by one difference a number, a share `stride` of it (of a lone
    block, one for each number), or `slopes` that are known, then by Broyden's rule (C. G. Broyden, Math. Comp. 19, 1965: secants
    where there is one number). Walking answers small changes with noise: there strides are long (WALKING)."""
    x = [np.clip(np.asarray(s, dtype=float), *b) for s, b in zip(start, bounds)]
    r = list(left)
    J = list(slopes) if slopes else [np.zeros((len(r_b), len(x_b))) for r_b, x_b in zip(r, x)]
    updated = [slopes is not None] * len(x)
    damping = [1e-3] * len(x)
    open_ = [len(x_b) > 0 for x_b in x]
    missed = [False] * len(x)
    seen = [[(x_b, float(r_b @ r_b))] for x_b, r_b in zip(x, r)]
    for _ in range(iterations):
        if not any(open_):
            break
        stale = [o and not u for o, u in zip(open_, updated)]
        found: list[list[tuple[Array, Array]]] = [[] for _ in x]
        if any(stale):
            columns = max(len(x_b) for x_b, s in zip(x, stale) if s)
            steps = [_steps(x_b, *b, stride) for x_b, b in zip(x, bounds)]
            points = [[x_b + np.eye(len(x_b))[i] * h[i] if s and i < len(x_b) else x_b for x_b, h, s in zip(x, steps, stale)]
                      for i in range(columns)]
            for i, answer in enumerate((yield points)):
                for b, v in enumerate(answer):
                    if stale[b] and i < len(x[b]):
                        J[b][:, i] = (v - r[b]) / steps[b][i]
                        found[b].append((points[i][b], v))
        trials = [[_step(x_b, r_b, J_b, d * k + extra, *b) if o else x_b
                   for x_b, r_b, J_b, d, b, o in zip(x, r, J, damping, bounds, open_)] for k, extra in ((1, 0.0), (30, 0.3))]
        for b, known in enumerate(seen):
            lowest = _lowest(known, *bounds[b]) if missed[b] else None
            if lowest is not None:
                trials[1][b] = lowest
        answers = yield trials
        for b in range(len(x)):
            if not open_[b]:
                continue
            tried = [(t[b], a[b]) for t, a in zip(trials, answers)] + found[b]
            costs = [float(v @ v) for _, v in tried]
            seen[b] += [(at, cost) for (at, _), cost in zip(tried, costs)]
            best, before = int(np.argmin(costs)), float(r[b] @ r[b])
            if not costs[best] < before:  # once more: from new differences where slopes were updated, else in a short step
                open_[b], missed[b] = updated[b] or not missed[b], missed[b] or not updated[b]
                updated[b] = not updated[b]
                damping[b] *= 1e3 if updated[b] else 1.0
                continue
            there, left_there = tried[best]
            moved = there - x[b]
            if moved @ moved > TINY**2:
                J[b] = J[b] + np.outer(left_there - r[b] - J[b] @ moved, moved) / (moved @ moved)
            updated[b], missed[b] = True, False
            open_[b] = before - costs[best] > SETTLED * before
            damping[b] = damping[b] / 3 if best == 0 else min(damping[b] * 10, 1.0)
            x[b], r[b] = there, left_there
    return [Solved(*solved) for solved in zip(x, r, J)]


def _steps(x: Array, low: Array, high: Array, stride: float | Array) -> Array:
    step = stride * np.maximum(np.abs(x), 0.3)
    return np.asarray(np.where(x + step <= high, step, -step))


def _lowest(seen: Sequence[tuple[Array, float]], low: Array, high: Array) -> Array | None:
    """Of one number, where the parabola through the three best sizes seen is lowest; None where it is not, or not known."""
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


def through(fit: Generator[list[Any], list[Any], T], ask: Callable[[Any], Any], tell: Callable[[Any], Any]
            ) -> Generator[list[Any], list[Any], T]:
    """A generator as part of another: what it wants goes out as `ask` puts it, what comes back goes in as `tell` does."""
    try:
        wants = next(fit)
        while True:
            answers = yield [ask(w) for w in wants]
            wants = fit.send([tell(a) for a in answers])
    except StopIteration as end:
        return end.value  # type: ignore[no-any-return]


def together(asking: Mapping[T, Generator[list[Any], list[Any], Any]], answer: Callable[[list[tuple[T, Any]]], list[Any]],
             report: Callable[[float], None] = lambda share: None) -> dict[T, Any]:
    """Runs generators side by side: what all of them want next is answered in one call. Returns what each returned."""
    done: dict[T, Any] = {}
    wants: dict[T, list[Any]] = {}

    def advance(key: T, sent: list[Any] | None) -> None:
        try:
            wants[key] = next(asking[key]) if sent is None else asking[key].send(sent)
        except StopIteration as end:
            wants.pop(key, None)
            done[key] = end.value

    for key in asking:
        advance(key, None)
    while wants:
        report(len(done) / max(1, len(asking)))
        flat = [(key, want) for key, wanted in wants.items() for want in wanted]
        answers = iter(answer(flat))
        for key, wanted in list(wants.items()):
            advance(key, [next(answers) for _ in wanted])
    return done
