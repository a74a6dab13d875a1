"""Responses to a candidate before it is fitted: the sizes at which they are scanned, and the size that they predict."""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from itertools import pairwise
from typing import TypeVar

import numpy as np
from scipy.optimize import Bounds, minimize

from workbench.identify.options import FIT
from workbench.identify.parameters import Candidate
from workbench.identify.rollouts.evaluator import RolloutRequest
from workbench.types import Array

T = TypeVar("T")
Part = Generator[list[RolloutRequest], list[dict[int, Array]], T]
"""A part of a search as a generator: requests, answers, result."""
Response = tuple[list[Array], list[list[Array]]]
"""Sizes at which a group was simulated, and the response to each, by block."""
ResponseBank = dict[tuple[object, ...], Response]
"""By group and takes."""


def scan_sizes(c: Candidate, walking: bool, no_fixed_base: bool) -> tuple[float, ...]:
    """Sizes at which an effect is simulated, in typical ones. no_fixed_base: whether no take had a fixed base, where joints show
    their errors, however large; effects that show under load alone may be large on a walk even so."""
    if walking and c.effect.layer == "ground":
        return FIT.scanned_ground
    return FIT.scanned if not walking or no_fixed_base or c.effect.under_load else FIT.scanned[:1]


def scan(c: Candidate, sizes: Sequence[float], walking: bool) -> list[Array]:
    """Sizes at which a candidate is looked at: of one number, several, both ways where it lifts feet; of more, each alone, of
    a walk all around."""
    if c.read_off:
        return [np.ones(c.size)]
    probes = c.around() if walking else c.probes()
    low, high = c.bounds()
    if len(probes) > 1 or not c.size:
        return [np.clip(FIT.scanned_around * p, low, high) for p in probes] if walking else probes
    lifts = walking and c.effect.layer == "structure" and low[0] < 0 < high[0]  # of four feet, this one or the others
    ways = (1.0, -1.0) if lifts else (1.0,)
    shapes = FIT.shaped if c.shapes.any() and not walking else (0.0,)
    if not walking and math.isinf(c.neutral[0]):
        sizes = sorted({*sizes, FIT.scanned_between})
    less = [-max(sizes)] if not walking and c.takes_away.any() else []  # of walks, the response to more of it has to do
    scales = [*(w * s for s in sizes for w in ways), *less]
    points = [np.clip(s * probes[0] + d * c.shapes, low, high) for d in shapes for s in scales]
    return [p for k, p in enumerate(points) if not any(np.allclose(p, other) for other in points[:k])]


def linearised_estimate(
    c: Candidate, r0: Array, probes: Sequence[Array], seen: Sequence[Array], far: float
) -> tuple[Array, float]:
    """Sizes to start from, and how much of the sum of squares responses say they take away."""
    whole = float(r0 @ r0)
    if not c.size:
        return np.empty(0), whole - float(seen[0] @ seen[0])
    low, high = c.bounds()
    if np.linalg.matrix_rank(np.array(probes)[:, ~c.shapes]) > 1:  # several numbers, not one at several sizes
        return _bent_guess(r0, np.array(probes), np.array(seen), (low, high), 2 * far)
    best = (probes[0], -np.inf)
    size = np.array([float(p[~c.shapes][0]) for p in probes])
    for shape, way in {(tuple(p[c.shapes]), np.sign(v)) for p, v in zip(probes, size)}:
        alike = [k for k in np.argsort(np.abs(size)) if np.sign(size[k]) == way and tuple(probes[k][c.shapes]) == shape]
        x, gain = _between(r0, [(0.0, r0), *((size[k], seen[k]) for k in alike)], far, (low[~c.shapes][0], high[~c.shapes][0]))
        if gain > best[1]:
            best = (np.where(c.shapes, probes[alike[0]], x), gain)
    return best


def _between(r0: Array, seen: Sequence[tuple[float, Array]], far: float, bounds: tuple[float, float]) -> tuple[float, float]:
    """The best size, and its gain, by linear interpolation between the simulated ones (with the residuals of each, from none on),
    and extrapolation beyond the first and the last: a servo at half its gain lags twice as much, at a fifth five times."""
    (_, first), last = seen[1], seen[-1]
    drawn_out = [((-far * seen[1][0], r0 - far * (first - r0)), seen[0]), (last, (far * last[0], r0 + far * (last[1] - r0)))]
    best = (seen[1][0], -np.inf)
    for (a, ra), (b, rb) in [*drawn_out, *pairwise(seen)]:
        D = rb - ra
        x = a - float(D @ ra) / max(float(D @ D), 1e-9) * (b - a)
        x = float(np.clip(np.clip(x, min(a, b), max(a, b)), *bounds))
        left = ra + (x - a) / (b - a) * D
        gain = float(r0 @ r0 - left @ left)
        if gain > best[1]:
            best = (x, gain)
    return best


def _bent_guess(r0: Array, points: Array, seen: Array, bounds: tuple[Array, Array], far: float) -> tuple[Array, float]:
    """The guess for several parameters: the responses at points (k, n) are described by a line for each parameter and, since
    walks respond nonlinearly, by squares of those that were simulated on both sides and the product of the first two; returns the
    sizes that minimise the sum of squares of that, or of a simulated point."""
    both = [i for i in range(points.shape[1]) if points[:, i].min() < 0 < points[:, i].max()]

    def terms(x: Array) -> Array:
        together = x[..., both[:2]].prod(axis=-1, keepdims=True) if len(both) > 1 else x[..., :0]
        return np.concatenate([x, x[..., both] ** 2, together], axis=-1)

    answers = np.linalg.lstsq(terms(points), seen - r0, rcond=1e-8)[0]
    G, g = answers @ answers.T, answers @ r0

    def cost(x: Array) -> float:
        return float(terms(x) @ G @ terms(x) + 2 * terms(x) @ g)

    reach = far * np.abs(points).max(axis=0)
    box = Bounds(np.maximum(bounds[0], -reach), np.minimum(bounds[1], reach))
    ends = [minimize(cost, start, method="L-BFGS-B", bounds=box) for start in (np.zeros(points.shape[1]), *points)]
    known = [(np.asarray(end.x, dtype=float), -float(end.fun)) for end in ends]
    known += [(p, float(r0 @ r0 - r @ r)) for p, r in zip(points, seen)]
    return max(known, key=lambda k: k[1])
