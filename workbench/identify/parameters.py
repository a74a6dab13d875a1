"""An effect at a place, with its numbers as sizes that a fit moves."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from workbench.effects.base import Effect, Parameter
from workbench.identify.options import FIT
from workbench.robot import EffectSpec, RobotModel
from workbench.types import Array, Mask

Key = tuple[str, tuple[str, ...]]
"""Name and place of an effect."""


@dataclass(frozen=True)
class Candidate:
    """An effect at a place. Its numbers are fitted as sizes x: 0 where the effect vanishes, 1 at the typical value; linear in the
    value, in its logarithm where it is a logarithmic ratio, or in its inverse where it vanishes at infinity (a stiffness, a
    ceiling); of a number that only shapes an effect (the
    speed at which friction fades) x is the number of doublings. fixed: by number, whether it is no matter of fitting (an axis
    that was read off the recording). reach: how far numbers go from neutral. options: parts of the effect that are there;
    numbers of others are none of its numbers. spread: standard deviations of numbers that were read off, in the formats page's
    units, by number; empty: they are not told. lowest: `Effect.lowest` of all the effect's parameters; empty: `Parameter.low`.
    less: whether it only takes from a constant; its size is 1 where a typical amount is gone."""

    effect: Effect
    where: tuple[str, ...]
    neutral: tuple[float, ...]
    typical: tuple[float, ...]
    fixed: tuple[bool, ...]
    reach: float = math.inf
    options: tuple[str, ...] = ()
    spread: tuple[float, ...] = ()
    lowest: tuple[float, ...] = ()
    less: bool = False

    @classmethod
    def of(cls, effect: Effect, where: tuple[str, ...], neutral: Sequence[float], typical: Sequence[float] | None = None,
           fixed: Sequence[bool] | None = None, options: tuple[str, ...] = (), lowest: tuple[float, ...] = ()) -> Self:
        """neutral: of all the effect's numbers; typical: of those that it has here, default the effect's own. lowest: as of the
        class."""
        given = [(p, n) for p, n in zip(_by_number(effect.parameters), neutral) if p.option in ("", *options)]
        own = tuple(p.typical_beside(n) for p, n in given)
        return cls(effect, where, tuple(n for _, n in given), tuple(typical or own), tuple(fixed or (False,) * len(own)),
                   options=options, lowest=lowest)

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @property
    def key(self) -> Key:
        """Effect and places: what tells one candidate from another."""
        return self.effect.name, self.where

    @property
    def joint(self) -> str | None:
        """The one joint in which it acts."""
        return self.where[0] if "joint" in self.effect.places and len(self.where) == 1 else None

    @property
    def read_off(self) -> bool:
        """Whether its sizes were estimated directly, 1 being the estimate."""
        return not self.effect.from_neutral

    @cached_property
    def given(self) -> list[Parameter]:
        """The effect's parameters, but those of options that it does not have here."""
        return [p for p in self.effect.parameters if p.option in ("", *self.options)]

    @cached_property
    def parameters(self) -> list[Parameter]:
        """The parameter behind each number; a vector has three."""
        return _by_number(self.given)

    @cached_property
    def least(self) -> list[float]:
        """The smallest possible value of each number, in the units of docs/formats.md."""
        lowest = dict(zip((p.name for p in self.effect.parameters), self.lowest))
        return [lowest.get(p.name, p.low) for p in self.parameters]

    @cached_property
    def takes_away(self) -> Mask:
        """Which sizes may be noticeably negative, because the effect can take away a constant of this robot."""
        far = [low < p.low and p.low - low >= FIT.least_taken * abs(t - n)
               for p, low, n, t in zip(self.parameters, self.least, self.neutral, self.typical)]
        return np.array([x for x, fixed in zip(far, self.fixed) if not fixed], dtype=bool)

    @cached_property
    def most(self) -> list[float]:
        """The largest possible value of each number, in the units of docs/formats.md."""
        return [n if self.less and p.adds_to else p.high for p, n in zip(self.parameters, self.neutral)]

    def one_way(self) -> list[Candidate]:
        """The candidate as it adds to a constant and, where that is possible, as it takes from it: two hypotheses with sizes of
        one sign each."""
        more = replace(self, lowest=())
        typical = tuple(2 * n - t if p.adds_to else t for p, n, t in zip(self.parameters, self.neutral, self.typical))
        return [more, replace(self, typical=typical, less=True)] if self.takes_away.any() else [more]

    def with_options(self, options: Iterable[str]) -> Candidate:
        """The same with these options; initially the numbers that make the effect are zero, those that shape it are typical."""
        neutral = tuple(p.typical if p.shapes else 0.0 for p in self.effect.parameters)
        c = Candidate.of(self.effect, self.where, neutral, options=tuple(sorted({*options})), lowest=self.lowest)
        return c.one_way()[-1] if self.less else c

    def without_zero(self, x: Array) -> tuple[Candidate, Mask]:
        """The same without the options of which all sizes x that make them are zero, and which sizes remain (all false if none
        makes anything)."""
        made = self.makes & ~np.isclose(x, 0.0)
        if not self.options:
            return self, np.full(len(x), made.any())
        options = np.array([p.option for p, fixed in zip(self.parameters, self.fixed) if not fixed])
        kept = [o for o in self.options if o not in options or made[options == o].any()]
        return (self if len(kept) == len(self.options) else self.with_options(kept)), np.isin(options, ["", *kept]) & made.any()

    @cached_property
    def size(self) -> int:
        """How many numbers are fitted."""
        return self.fixed.count(False)

    @cached_property
    def shapes(self) -> Mask:
        """Which sizes belong to numbers that only shape the effect."""
        return np.array([p.shapes for p, fixed in zip(self.parameters, self.fixed) if not fixed], dtype=bool)

    @property
    def of_vector(self) -> Mask:
        """Which sizes are components of a vector."""
        return np.array([p.vector for p, fixed in zip(self.parameters, self.fixed) if not fixed], dtype=bool)

    def magnitudes(self, x: Array) -> Array:
        """Magnitudes to which the step of each slope is relative: a small component of a long vector, such as the height of a
        load, is moved by as much as the others, or its response drowns in the contact noise of small changes."""
        out = np.maximum(np.abs(x), FIT.least_move)
        vector = self.of_vector
        out[vector] = np.maximum(out[vector], FIT.vector_move * np.linalg.norm(x[vector]))
        return np.asarray(out)

    def values(self, x: Sequence[float] | Array) -> list[float]:
        """Parameters in the units of docs/formats.md, limited to their bounds; x: of those that are fitted."""
        sizes = iter(np.asarray(x, dtype=float).tolist())
        out = []
        ends = zip(self.least, self.most)
        for p, (low, high), n, t, fixed in zip(self.parameters, ends, self.neutral, self.typical, self.fixed):
            size = 1.0 if fixed else next(sizes)
            if fixed:
                value = t
            elif math.isinf(n):
                value = t / max(size, t / p.high)
            else:
                value = n * 2.0 ** min(size, FIT.most_doubled) if p.shapes else _at(p, size, n, t)
            out.append(float(min(max(value, low), high)))
        return out

    def sizes(self, values: Sequence[float]) -> Array:
        """The sizes of finite neutral values at these numbers, in the units of docs/formats.md, as far as they may go."""
        x = [_size(p, v, n, t) for p, v, n, t, fixed in zip(self.parameters, values, self.neutral, self.typical, self.fixed)
             if not fixed]
        return np.asarray(np.clip(x, *self.bounds()))

    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the sizes x, lower and upper."""
        low, high = [], []
        limits = zip(self.least, self.most)
        for p, (least, most), n, t, fixed in zip(self.parameters, limits, self.neutral, self.typical, self.fixed):
            if fixed:
                continue
            if math.isinf(n):
                ends = [0.0, t / p.low]
            elif p.shapes:
                ends = [math.log2(end / n) if end > 0 else -10.0 for end in (p.low, p.high)]
            else:
                near, far = (n * math.exp(-self.reach), n * math.exp(min(self.reach, 100.0))) if p.logarithmic else (
                    n - self.reach, n + self.reach)
                ends = [_size(p, end, n, t) for end in (max(least, near), min(most, far))]
            low.append(min(ends))
            high.append(max(ends))
        return np.array(low), np.array(high)

    def seldom(self) -> Array:
        """For each size, the value that only one in a hundred exceeds where the effect is there at all; NaN where nobody says."""
        out = []
        for p, n, t, fixed in zip(self.parameters, self.neutral, self.typical, self.fixed):
            if not fixed:
                x = t / p.seldom_beyond if math.isinf(n) else math.nan if p.shapes else _size(p, p.seldom_beyond, n, t)
                out.append(abs(x))
        return np.array(out)

    def probes(self) -> list[Array]:
        """Sizes at which each number that shows from neutral on is alone typical: not those that shape an effect, nor a vector
        that says where a scalar acts; one empty for an effect without numbers."""
        scalar = any(not p.vector for p in self.given)
        fitted = [p for p, fixed in zip(self.parameters, self.fixed) if not fixed]
        shown = [i for i, p in enumerate(fitted) if not p.shapes and not (scalar and p.vector)]
        return [np.eye(self.size)[i] for i in shown] or [np.zeros(self.size)]

    def around(self) -> list[Array]:
        """Perturbations in both directions and, of the first two, together: the response to a sideways push depends on a forward
        one. Only the perturbations themselves where there is one parameter."""
        probes = self.probes()
        return probes if len(probes) < 2 else both_ways(np.zeros(self.size), probes)

    @property
    def makes(self) -> Mask:
        """Which sizes make the effect: where all are 0, it is not there."""
        return ~self.shapes

    def spec(self, x: Sequence[float] | Array) -> EffectSpec:
        """The effect at these sizes."""
        rest = iter(self.values(x))
        parameters: dict[str, float | tuple[float, float, float]] = {}
        for p in self.given:
            parameters[p.name] = (next(rest), next(rest), next(rest)) if p.vector else next(rest)
        return EffectSpec(self.effect.name, self.where, parameters)

    def __str__(self) -> str:
        return f"{self.effect.name}({','.join(self.where)})"


def _at(p: Parameter, size: float, neutral: float, typical: float) -> float:
    """The value of a number at a size."""
    if p.logarithmic:
        return neutral * math.exp(min(size * math.log(typical / neutral), 100.0))
    return neutral + size * (typical - neutral)


def _size(p: Parameter, value: float, neutral: float, typical: float) -> float:
    """The size of a number at a value."""
    if p.shapes:
        return math.log2(value / neutral)
    if p.logarithmic:
        return math.log(value / neutral) / math.log(typical / neutral)
    return (value - neutral) / (typical - neutral)


def both_ways(middle: Array, ways: Sequence[Array]) -> list[Array]:
    """Steps from `middle` along each of these ways, forth and back, and the first two together."""
    signs = (1.0, -1.0)
    return [*(middle + s * way for s in signs for way in ways),
            *(middle + s * ways[0] + t * ways[1] for s in signs for t in signs)]


def _by_number(parameters: Sequence[Parameter]) -> list[Parameter]:
    """The parameter behind each number; a vector has three."""
    return [p for p in parameters for _ in range(3 if p.vector else 1)]


def with_effects(nominal: RobotModel, effects: Sequence[tuple[Candidate, Array]]) -> RobotModel:
    """The nominal robot with effects of given sizes, one after the other."""
    return nominal.with_effects((*nominal.effects, *(c.spec(x) for c, x in effects)))
