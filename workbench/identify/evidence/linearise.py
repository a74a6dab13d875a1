"""The response of each additional effect around a fit, and the evidence predicted from it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise, product

import numpy as np

from workbench.identify.evidence.fit import Asks, Fitted, evaluate, slopes
from workbench.identify.evidence.hypothesis import Hypothesis, Prior, labels_of
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.region import Region
from workbench.identify.options import FIT
from workbench.identify.parameters import Candidate
from workbench.types import Array, Mask

BETWEEN, BEYOND = (0.25, 0.5, 0.75), (0.25, 0.5, 1.0)
"""Shares of the way between two sizes that were seen, and beyond the last and to the other side, at which lines are read."""


@dataclass(frozen=True)
class Move:
    """A hypothesis from which a fit could continue. r: predicted residuals; J: their slopes; gain [nats]: of log posterior."""

    hypothesis: Hypothesis
    r: Array
    J: Array
    gain: float
    added: tuple[Candidate, ...] = ()


@dataclass(frozen=True)
class Probe:
    """A candidate at sizes x, of which parameter `moved` is its amplitude (-1: it has none); r: the residuals with it."""

    candidate: Candidate
    x: Array
    moved: int
    r: Array


def extensions(region: Region, h: Hypothesis) -> list[Candidate]:
    """Effects that the hypothesis lacks, and its own with one option more."""
    there, ties = {c.key for c in h.effects}, {c.effect.tied for c in h.effects}
    out = [c for c in region.candidates
           if c.key not in there and (c.effect.tied is None or c.effect.tied not in ties)]
    for c in h.effects:
        more = dict.fromkeys(p.option for p in c.effect.parameters if p.option and p.option not in c.options)
        out += [c.with_options((*c.options, name)) for name in more]
    return out


def akin(region: Region, options: EvidenceOptions, h: Hypothesis) -> list[list[Hypothesis]]:
    """Each hypothesis that differs from this one in one effect of the same kind, at several sizes: an effect is exchanged for
    another of its family or tie, or gets one more option. Effects with a vector are left out, as it has no typical direction."""
    made: list[tuple[Hypothesis, Candidate]] = []
    for gone in h.effects:
        kinds, rest = {gone.effect.family, gone.effect.tied} - {None}, h.without(lambda c, gone=gone: c is gone)
        made += [(rest, c) for c in extensions(region, rest)
                 if c.name != gone.name and kinds & {c.effect.family, c.effect.tied} and not c.of_vector.any() and not c.read_off]
    made += [(h, c) for c in extensions(region, h) if c.key in {own.key for own in h.effects}]
    return [[rest.with_effect(c, np.where(c.shapes, 0.0, share)) for share in options.sizes] for rest, c in made]


def linearise(region: Region, options: EvidenceOptions, f: Fitted) -> Asks[list[Move]]:
    """Every extension at some sizes, with the predicted gain at its best one; the best first."""
    asked = [(c, x, k) for c in extensions(region, f.hypothesis) for x, k in points(c, f.hypothesis)]
    left = yield [f.hypothesis.with_effect(c, x) for c, x, _ in asked]
    along = ways([Probe(c, x, k, r) for (c, x, k), r in zip(asked, left)])
    return best_of_each([_best_along(region, options, f, probes) for probes in along])


def linearised_around(region: Region, options: EvidenceOptions, h: Hypothesis) -> Asks[tuple[Fitted, list[Move]]]:
    """Every extension of a hypothesis as it stands, without a fit of it."""
    (r,) = yield [h]
    there = evaluate(region, options, h, r, (yield from slopes(options, h, r)))
    return there, (yield from linearise(region, options, there))


def ways(probes: Sequence[Probe]) -> list[list[Probe]]:
    """Probes that differ by one number alone together."""
    out: dict[object, list[Probe]] = {}
    for p in probes:
        shape = tuple(np.delete(p.x, p.moved).round(6)) if p.moved >= 0 else ()
        out.setdefault((p.candidate, p.moved, shape), []).append(p)
    return list(out.values())


def best_of_each(moves: Sequence[Move]) -> list[Move]:
    """The best move to each set of effects, the best first."""
    out: dict[object, Move] = {}
    for m in sorted(moves, key=lambda m: -m.gain):
        out.setdefault(m.hypothesis.key, m)
    return list(out.values())


def choose_moves(alone: Sequence[Move], both: Sequence[Move], options: EvidenceOptions) -> list[Move]:
    """The best moves of one effect, as many as the beam, and as many moves of two effects, but at most two pairs per leading
    effect, since pair predictions are less reliable than the leading effect itself."""
    out, led = list(alone[:options.beam]), Counter[object]()
    for m in both:
        leads = (m.added[0].key, m.added[0].options)
        if len(out) < options.refined and led[leads] < options.led:
            out.append(m)
            led[leads] += 1
    return out


def in_pairs(region: Region, options: EvidenceOptions, f: Fitted, moves: Sequence[Move]) -> list[Move]:
    """Two of the best moves at once, predicted by the sum of their responses."""
    return [_both(region, options, f, a, b) for a, b in combinations(moves[:options.paired], 2)
            if (a.added[0].key != b.added[0].key or a.added[0].key in {c.key for c in f.hypothesis.effects})
            and not _are_tied(a.added[0], b.added[0])]


def _are_tied(a: Candidate, b: Candidate) -> bool:
    return a.effect.tied is not None and a.effect.tied == b.effect.tied and a.key != b.key


def _both(region: Region, options: EvidenceOptions, f: Fitted, a: Move, b: Move) -> Move:
    """Two moves at once: the responses are added, and the parameters of the fit are re-optimised linearly."""
    (one,), (two,) = a.added, b.added
    if one.key == two.key:  # two options of one effect that is there
        two = two.with_options((*one.options, *two.options))
    sizes = {**dict(zip(b.hypothesis.labels, b.hypothesis.theta)), **dict(zip(a.hypothesis.labels, a.hypothesis.theta))}
    sizes |= {label: x for label, x in zip(b.hypothesis.labels, b.hypothesis.theta) if label not in f.hypothesis.labels}
    h = a.hypothesis.with_effect(two, np.array([sizes[label] for label in labels_of(two)]))
    at = dict(zip(f.hypothesis.labels, f.hypothesis.theta))
    led_after_b = [(k, x - at[label]) for k, (label, x) in enumerate(zip(b.hypothesis.labels, b.hypothesis.theta)) if label in at]
    r = a.r + (b.r - f.r) - sum((b.J[:, k] * by for k, by in led_after_b), np.zeros(len(f.r)))
    J, led = slopes_for(f, h)
    for m in (a, b):
        for label, column in zip(m.hypothesis.labels, m.J.T):
            if label not in at:
                J[:, h.labels.index(label)] = column
    return _judged(region, options, f, *led_after(region, options, f, h, r, J, led), (*a.added, two))


def slopes_for(f: Fitted, h: Hypothesis) -> tuple[Array, Mask]:
    """The fit's slopes in the order of another hypothesis' numbers, 0 of those that it lacks, and which it has."""
    column = dict(zip(f.hypothesis.labels, f.J.T))
    known = np.array([label in column for label in h.labels])
    J = np.column_stack([column.get(label, np.zeros(len(f.r))) for label in h.labels]) if len(known) else np.empty((len(f.r), 0))
    return J, known


def points(c: Candidate, h: Hypothesis) -> list[tuple[Array, int]]:
    """Sizes at which a candidate is looked at, and which number is moved there."""
    low, high = c.bounds()
    if c.read_off or not c.size:
        return [(np.ones(c.size), -1)]
    if len({p.vector for p in c.given}) > 1:  # a load: its probes are where it may hang
        return [(np.clip(p, low, high), -1) for p in c.probes()]
    own = dict(zip(h.labels, h.theta))
    start = np.array([own.get(label, 0.0) for label in labels_of(c)])
    new = np.array([label not in own for label in labels_of(c)])
    shapes = FIT.shaped if (c.shapes & new).any() else (0.0,)
    endless = any(np.isinf(n) for n in c.neutral)  # as a ceiling, which shows nothing until it is met
    amounts = sorted((*FIT.scanned, FIT.scanned_between)) if endless else FIT.scanned
    out: list[tuple[Array, int]] = []
    for k, d, amount in product(np.flatnonzero(new & ~c.shapes), shapes, amounts):
        x = start + d * (c.shapes & new)
        x[k] = amount
        x = np.clip(x, low, high)
        if not any(np.allclose(x, other) for other, _ in out):
            out.append((x, int(k)))
    return out


def on_lines(none: Array, along: Sequence[Probe]) -> list[tuple[Array, Array]]:
    """Sizes along one direction of a candidate and the predicted residuals of each: linear interpolation between the simulated
    ones, starting at none, and extrapolation beyond the last and to the other side. none (n,): residuals without it."""
    k = along[0].moved
    if k < 0:
        return [(p.x, p.r) for p in along]
    low, high = along[0].candidate.bounds()
    seen = sorted(along, key=lambda p: abs(p.x[k]))
    knots = [(0.0, none), *((float(p.x[k]), p.r) for p in seen)]
    read = [*knots[1:]]
    for (a, ra), (b, rb) in pairwise(knots):
        read += [(a + share * (b - a), ra + share * (rb - ra)) for share in BETWEEN]
    (a, ra), (b, rb) = knots[-2:]
    read += [(b + share * (b - a), rb + share * (rb - ra)) for share in BEYOND]
    read += [(-share * knots[1][0], none - share * (knots[1][1] - none)) for share in (*BETWEEN, *BEYOND)]
    out = []
    for amount, r in read:
        if low[k] <= amount <= high[k]:
            x = seen[0].x.copy()
            x[k] = amount
            out.append((x, r))
    return out


def _best_along(region: Region, options: EvidenceOptions, f: Fitted, along: Sequence[Probe]) -> Move:
    """The best move along one way of a candidate."""
    c, k, s = along[0].candidate, along[0].moved, f.discrepancy
    led = [led_after(region, options, f, *_at(f, c, k, x, r)) for x, r in on_lines(f.r, along)]
    prior = Prior.of(led[0][0], options)
    best = max(led, key=lambda m: region.likelihood.log(m[1], s) + prior.log(m[0].theta))
    return _judged(region, options, f, *best, (c,))


def _at(f: Fitted, c: Candidate, k: int, x: Array, r: Array) -> tuple[Hypothesis, Array, Array, Mask]:
    """A candidate at sizes x that leave r: with that, slopes, and which numbers may be led after it."""
    h = f.hypothesis.with_effect(c, x)
    J, led = slopes_for(f, h)
    if c.size:
        own = h.slices()[-1]
        moved = k if k >= 0 else 0
        J[:, own.start + moved] = (r - f.r) / (x[moved] if abs(x[moved]) > 1e-6 else 1.0)
        led[own] = False
    return h, r, J, led


def led_after(region: Region, options: EvidenceOptions, f: Fitted, h: Hypothesis, r: Array, J: Array, led: Mask
              ) -> tuple[Hypothesis, Array, Array]:
    """A hypothesis whose other parameters are re-optimised linearly, its residuals, and slopes."""
    prior = Prior.of(h, options)
    precision = region.likelihood.precision(r, f.discrepancy)
    theta, left = h.theta.copy(), r
    if led.any():
        G, P = J[:, led], prior.precision(theta)[led]
        pull = P * (theta - prior.center)[led]
        step = -np.linalg.solve((G.T * precision) @ G + np.diag(P), G.T @ (precision * r) + pull)
        low, high = h.bounds()
        theta[led] = np.clip(theta[led] + step, low[led], high[led])
        left = r + G @ (theta - h.theta)[led]
    return h.at(theta), left, J


def _judged(region: Region, options: EvidenceOptions, f: Fitted, h: Hypothesis, r: Array, J: Array, added: tuple[Candidate, ...]
            ) -> Move:
    return Move(h, r, J, evaluate(region, options, h, r, J).log_posterior - f.log_posterior, added)
