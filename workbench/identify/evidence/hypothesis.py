"""A hypothesis about one region: its servo constants that may be recalibrated, its effects, and their prior."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaln, stdtrit

from workbench.effects.base import Effect
from workbench.effects.registry import estimated_by
from workbench.identify.evidence.options import NUMERICS, EvidenceOptions
from workbench.robot import EffectSpec
from workbench.types import Array, Mask

if TYPE_CHECKING:
    from workbench.identify.evidence.torque_law import TorqueLaw
    from workbench.identify.parameters import Candidate

FAR = EvidenceOptions.far
"""Limit of a recalibrated constant [standard deviations]: beyond it is a finding, named after the corresponding effect."""
UNNAMED = "unknown torque"
"""Represents a torque law among the terms of a hypothesis."""
ZERO = "zero"
"""Name of a joint's zero among the numbers that are recalibrated."""
PART_OF = {"dead_zone": "margin", "minimum_duty": "punch_duty"}
"""Numbers that are one part of a constant to which effects add, and that constant."""
ADDITIVE = ("goal_delay",)
"""Numbers that are sums of parts (rounds of a bus, of an adapter, of a servo's loop), of which each may be absent."""
Term = tuple[str, tuple[str, ...], tuple[str, ...]]
"""An effect's name, where it acts, and its options."""
Label = tuple[str, tuple[str, ...], str, int]
"""Which number: an effect's name, where it acts, the parameter and its component; of the nominal law "" and the joint."""


def zero_effect() -> Effect:
    """The effect that turns a joint's zero."""
    return estimated_by("turn about an axis")[0]


@dataclass(frozen=True)
class Uncertain:
    """One constant of one joint's servo that is known to `sd`: a share of its nominal value, or [rad] for ZERO. z standard
    deviations make it nominal · exp(sd z), one of ADDITIVE nominal · (1 + sd z), and a zero of sd z. others: the constants that
    change with it, and their change for each standard deviation, where an earlier diagnosis knew only a combination; all z are
    still independent in the prior. nominal: the nominal value, in the unit in which an effect adds to it [SI]."""

    joint: str
    name: str
    sd: float
    others: tuple[tuple[str, float], ...] = ()
    nominal: float = math.nan

    @property
    def changes(self) -> dict[str, float]:
        """How far one standard deviation moves each number: the logarithm of it, a share of ADDITIVE, [rad] of ZERO."""
        return {self.name: self.sd, **dict(self.others)}

    def is_changed_by(self, effect: Effect) -> bool:
        """Whether an effect changes the same constant."""
        if self.name == ZERO:
            return effect == zero_effect()
        return effect.name == self.name or any(p.adds_to == PART_OF.get(self.name, self.name) for p in effect.parameters)

    def __str__(self) -> str:
        return f"{self.name}({self.joint})"


def factor_of(name: str, by: Array | float) -> Array | float:
    """A recalibrated constant over its nominal value. by: its changes added up, of `Uncertain.changes`."""
    return np.maximum(1.0 + np.asarray(by), 0.0) if name in ADDITIVE else np.exp(by)


def term_of(c: Candidate) -> Term:
    """Name and place of a candidate."""
    return (c.name, c.where, c.options)


def labels_of(c: Candidate) -> list[Label]:
    """Labels of a candidate's sizes, whichever options it has."""
    fitted = [p.name for p, fixed in zip(c.parameters, c.fixed) if not fixed]
    if len(fitted) != c.size:  # moments, of a mass that swings
        fitted = ["size"] * c.size
    return [(c.name, c.where, name, fitted[:k].count(name)) for k, name in enumerate(fitted)]


@dataclass(frozen=True)
class Hypothesis:
    """Effects at joints or links, in addition to the nominal law. theta (k,): standard deviations of the recalibrated constants,
    then the effects' sizes (`Candidate`). law: an additional torque that no effect describes."""

    numbers: tuple[Uncertain, ...]
    effects: tuple[Candidate, ...]
    theta: Array = field(repr=False)
    law: TorqueLaw | None = None

    @property
    def key(self) -> frozenset[Term]:
        """The set of effects, whatever their sizes, and the variables of an unnamed torque."""
        unnamed = () if self.law is None else [(UNNAMED, (self.law.joint,), tuple(sorted(self.law.scales)))]
        return frozenset([*(term_of(c) for c in self.effects), *unnamed])

    @property
    def z(self) -> Array:
        """The recalibrated numbers (standard deviations from nominal)."""
        return self.theta[:len(self.numbers)]

    @property
    def labels(self) -> list[Label]:
        """Labels of theta's numbers."""
        nominal = [("", (n.joint,), n.name, 0) for n in self.numbers]
        return [*nominal, *(label for c in self.effects for label in labels_of(c))]

    def slices(self) -> list[slice]:
        """The part of theta that belongs to each effect."""
        ends = accumulate((c.size for c in self.effects), initial=len(self.numbers))
        return [slice(a, b) for a, b in pairwise(ends)]

    def alike(self) -> list[list[int]]:
        """Pairs of theta that represent one constant of the law: its recalibration, and the effect that changes it there."""
        return [[k, s.start] for c, s in zip(self.effects, self.slices()) for k, n in enumerate(self.numbers)
                if c.size == 1 and c.where == (n.joint,) and not n.others and n.is_changed_by(c.effect)]

    def sizes(self) -> list[tuple[Candidate, Array]]:
        """Each effect with its part of theta."""
        return [(c, self.theta[s]) for c, s in zip(self.effects, self.slices())]

    def specs(self) -> list[EffectSpec]:
        """The effects, as a model has them."""
        return [c.spec(x) for c, x in self.sizes()]

    def at(self, theta: Array) -> Hypothesis:
        """The same hypothesis with other numbers theta."""
        return replace(self, theta=np.asarray(theta, dtype=float))

    def with_effect(self, c: Candidate, x: Array) -> Hypothesis:
        """The hypothesis with one more effect, which replaces the same one with other options."""
        bare = self.without(lambda other: other.key == c.key)
        return replace(bare, effects=(*bare.effects, c), theta=np.concatenate([bare.theta, x]))

    def without(self, gone: object) -> Hypothesis:
        """Without the effects for which `gone` (a function of a Candidate) holds."""
        keep = [(c, x) for c, x in self.sizes() if not gone(c)]  # type: ignore[operator]
        return replace(self, effects=tuple(c for c, _ in keep), theta=np.concatenate([self.z, *(x for _, x in keep)]))

    def without_zero(self) -> tuple[Hypothesis, Mask]:
        """Without the effects, and options of effects, that are zero; which of theta's numbers remain (k,)."""
        each = [(*c.without_zero(x), x) for c, x in self.sizes()]
        effects = tuple(c for c, remain, _ in each if remain.any())
        remain = np.concatenate([np.ones(len(self.numbers), dtype=bool), *(remain for _, remain, _ in each)])
        return replace(self, effects=effects, theta=self.theta[remain]), remain

    def bounds(self) -> tuple[Array, Array]:
        """Bounds of theta, lower and upper."""
        n = len(self.numbers)
        ends = [(np.full(n, -FAR), np.full(n, FAR)), *(c.bounds() for c in self.effects)]
        return np.concatenate([low for low, _ in ends]), np.concatenate([high for _, high in ends])

    def constant(self, k: int, z: Array | float) -> Array:
        """The constant that number k recalibrates, at z standard deviations of it [SI]; NaN where its nominal value is not
        given."""
        n = self.numbers[k]
        if n.name == ZERO:
            return np.asarray(n.sd * np.asarray(z))
        by_others = sum(x * other.changes.get(n.name, 0.0) for j, (other, x) in enumerate(zip(self.numbers, self.z))
                        if j != k and other.joint == n.joint)
        return np.asarray(n.nominal * factor_of(n.name, by_others + n.sd * np.asarray(z)))

    def adds(self, i: int, to: int) -> float:
        """The amount that a unit of the effect's size, number i of theta, adds to the constant of number `to` [SI]; NaN where the
        effect changes it otherwise."""
        c = next(c for c, s in zip(self.effects, self.slices()) if s.start == i)
        adds = c.parameters[0].adds_to or self.numbers[to].name == ZERO
        return (c.typical[0] - c.neutral[0]) * c.parameters[0].si if adds else math.nan


@dataclass(frozen=True)
class Prior:
    """Prior of a hypothesis' parameters: normal for recalibrated constants and doublings, Student's t for sizes, half of it where
    they have one sign, with degrees of freedom and width such that one in a hundred exceeds the effect's `seldom_beyond`; else
    Cauchy's. center (k,), scale (k,); normal, one_sided (k,); freedom (k,)."""

    center: Array
    scale: Array
    normal: Mask
    one_sided: Mask
    freedom: Array

    @classmethod
    def of(cls, h: Hypothesis, options: EvidenceOptions) -> Prior:
        """The prior of a hypothesis, whatever its sizes; the same object for the same numbers and effects."""
        return _prior(len(h.numbers), h.effects, options)

    def rows(self, theta: Array) -> Array:
        """Numbers of which half the squares are the log prior but for a constant."""
        z = (theta - self.center) / self.scale
        v = self.freedom
        return np.asarray(np.where(self.normal, z, np.copysign(np.sqrt((v + 1) * np.log1p(z * z / v)), z)))

    def log(self, theta: Array) -> float:
        """Log density [nats]."""
        z = (theta - self.center) / self.scale
        v = self.freedom
        return float(np.sum(self.at_center - np.where(self.normal, 0.5 * z * z, (v + 1) / 2 * np.log1p(z * z / v))))

    @property
    def at_center(self) -> Array:
        """Log density of each number (k,) where it is largest [nats]."""
        v = self.freedom
        student = gammaln((v + 1) / 2) - gammaln(v / 2) - 0.5 * np.log(np.pi * v) + np.log(2.0) * self.one_sided
        return np.asarray(np.where(self.normal, -0.5 * np.log(2 * np.pi), student) - np.log(self.scale))

    def precision(self, theta: Array) -> Array:
        """How sharply it tells each number (k,), as reweighted least squares have it."""
        z = (theta - self.center) / self.scale
        v = self.freedom
        return np.asarray(np.where(self.normal, 1.0, (v + 1) / (v + z * z)) / np.square(self.scale))


def split_sums(h: Hypothesis, J: Array, options: EvidenceOptions) -> tuple[Hypothesis, Array]:
    """The hypothesis with each constant that is recalibrated, and to which an effect adds, split between the two where the prior
    is largest, which changes no residual; and J (n, k), the residuals' slopes by theta, there.

    Along this line the likelihood is constant, and a fit stops anywhere on it. But evidence compares the best of each model, and
    beside a constant recalibrated to its limit an effect would be so small that it seems to be absent."""
    for k, i in h.alike():
        unit, here = h.adds(i, k), h.theta[k]
        total, factor = h.constant(k, here) + unit * h.theta[i], h.numbers[k].name not in (ZERO, *ADDITIVE)
        if not np.isfinite(total) or (h.numbers[k].name != ZERO and total <= 0):
            continue  # the effect takes away all that there is: more of it changes nothing
        each = np.linspace(-FAR, FAR, NUMERICS.splits)
        theta = np.tile(h.theta, (len(each) + 1, 1))
        theta[1:, k], theta[1:, i] = each, (total - h.constant(k, each)) / unit
        low, high = h.bounds()
        possible = (theta[:, i] >= low[i]) & (theta[:, i] <= high[i])
        cost = np.square(Prior.of(h, options).rows(theta)[:, [k, i]]).sum(axis=1)
        best = theta[np.argmin(np.where(possible, cost, np.inf))]
        if factor:
            J = J.copy()
            J[:, k] *= h.constant(k, best[k]) / h.constant(k, here)
        h = h.at(best)
    return h, J


def log_odds(names: int, expected: float) -> float:
    """Prior log odds of one more effect [nats], among so many names, of which `expected` are thought to be there."""
    share = min(0.5, expected / max(names, 1))
    return float(np.log(share / (1 - share)))


def start(numbers: Sequence[Uncertain]) -> Hypothesis:
    """The nominal law as it stands."""
    return Hypothesis(tuple(numbers), (), np.zeros(len(numbers)))


@lru_cache(maxsize=1024)
def _prior(n: int, effects: tuple[Candidate, ...], options: EvidenceOptions) -> Prior:
    center, scale, normal, one_sided = [np.zeros(n)], [np.ones(n)], [np.ones(n, bool)], [np.zeros(n, bool)]
    freedom, furthest = [np.ones(n)], float(stdtrit(options.freedom, 0.995))
    for c in effects:
        low, high = c.bounds()
        shapes, seldom = c.shapes, np.full(c.size, np.nan) if c.read_off else c.seldom()
        has_usual = np.isfinite(seldom)
        center.append(np.where(c.read_off, 1.0, np.zeros(c.size)))
        width = np.where(has_usual, seldom / furthest, 1.0 if c.read_off else options.width)
        scale.append(np.where(shapes, options.doublings, width))
        freedom.append(np.where(has_usual, options.freedom, 1.0))
        normal.append(shapes)
        one_sided.append(~shapes & ((low >= 0) | (high <= 0)) & (not c.read_off))
    return Prior(*(np.concatenate(x) for x in (center, scale, normal, one_sided, freedom)))
