"""Two models that a session cannot separate, and the parameters that each may adapt."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from workbench.effects.registry import effect_named
from workbench.experiment.options import EXPERIMENT
from workbench.robot import EffectSpec, RobotModel
from workbench.types import Array


@dataclass(frozen=True, eq=False)
class Rival:
    """One of two: its model, and the effects by index whose parameters may adapt, those that the other has not."""

    model: RobotModel
    own: tuple[int, ...]

    @property
    def freedom(self) -> Array:
        """How far each number of its own effects may still go (p,), in the units of docs/formats.md."""
        return np.array([EXPERIMENT.freedom * n.felt for n in self._numbers()])

    def move(self, x: Array) -> Rival:
        """The rival with its numbers moved by x (p,), in units of `freedom`, as far as is possible."""
        values = [float(np.clip(n.value + dx * f, n.low, n.high)) for n, dx, f in
                  zip(self._numbers(), x, self.freedom, strict=True)]
        effects = list(self.model.effects)
        at = iter(values)
        for i in self.own:
            spec = effects[i]
            effects[i] = EffectSpec(spec.effect, spec.where, {
                p.name: (next(at), next(at), next(at)) if p.vector else next(at)
                for p in effect_named(spec.effect).parameters if p.name in spec.parameters})
        return replace(self, model=self.model.with_effects(effects))

    def steps(self) -> Array:
        """A step of each number for sensitivities (p,), in units of `freedom`, away from the nearer bound."""
        return np.array(
            [
                EXPERIMENT.step if n.value + EXPERIMENT.step * f <= n.high else -EXPERIMENT.step
                for n, f in zip(self._numbers(), self.freedom)
            ]
        )

    def neighbours(self) -> list[Rival]:
        """The rival with each number moved by its step, one at a time."""
        steps = self.steps()
        return [self.move(np.eye(len(steps))[i] * steps[i]) for i in range(len(steps))]

    def _numbers(self) -> list[_Number]:
        out = []
        for i in self.own:
            spec = self.model.effects[i]
            effect = effect_named(spec.effect)
            neutral = iter(effect.neutral(self.model))
            lowest = effect.lowest(self.model.with_effects([e for k, e in enumerate(self.model.effects) if k != i]), spec.where)
            for p, low in zip(effect.parameters, lowest):
                at_neutral = [next(neutral) for _ in range(3 if p.vector else 1)]
                if p.name not in spec.parameters:
                    continue
                given = spec.parameters[p.name]
                for v, n in zip(given if isinstance(given, tuple) else (given,), at_neutral):
                    out.append(_Number(float(v), low, p.high, p.typical_beside(n), math.inf if p.shapes else n, p.vector))
        return out


@dataclass(frozen=True)
class _Number:
    """One number of an effect and its bounds; neutral: where the effect vanishes, infinite of one that only shapes it; part: of
    a vector."""

    value: float
    low: float
    high: float
    typical: float
    neutral: float
    part: bool

    @property
    def felt(self) -> float:
        """What there is of it: its distance from neutral, where that is finite, and no less than a fifth of the typical one."""
        if not np.isfinite(self.neutral):
            return abs(self.value)
        least = abs(self.typical - self.neutral)
        return max(abs(self.value - self.neutral), least if self.part else 0.2 * least)


@dataclass(frozen=True, eq=False)
class Pair:
    """Two rivals."""

    a: Rival
    b: Rival

    @staticmethod
    def of(a: RobotModel, b: RobotModel) -> Pair:
        """Effects of the same name and place are taken for shared."""
        places = [{(e.effect, e.where) for e in m.effects} for m in (a, b)]
        own = [tuple(i for i, e in enumerate(m.effects) if (e.effect, e.where) not in other)
               for m, other in ((a, places[1]), (b, places[0]))]
        return Pair(Rival(a, own[0]), Rival(b, own[1]))

    @property
    def effects(self) -> tuple[EffectSpec, ...]:
        """The effects in which the two differ."""
        return tuple(r.model.effects[i] for r in (self.a, self.b) for i in r.own)

    @property
    def names(self) -> tuple[str, str]:
        """Names of the effect that each has and the other has not; several are joined by +, none is nominal."""
        first, second = ("+".join(r.model.effects[i].effect for i in r.own) or "nominal" for r in (self.a, self.b))
        return first, second

    @property
    def models(self) -> list[RobotModel]:
        """First and second; with those of `neighbours` they are the pair's cast."""
        return [self.a.model, self.b.model]

    @property
    def neighbours(self) -> list[RobotModel]:
        """The neighbours of the first, then of the second, from which sensitivities are computed."""
        return [r.model for r in (*self.a.neighbours(), *self.b.neighbours())]
