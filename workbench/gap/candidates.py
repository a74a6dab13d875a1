"""Every effect at every place where it could act and where these takes could show it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect, Parameter
from workbench.effects.registry import known_effects
from workbench.gap.evidence import TakeEvidence
from workbench.gap.footfalls import foot_points
from workbench.robot import EffectSpec, RobotModel

Array = NDArray[np.float64]


HEAVY = 0.15
"""Share of the robot's mass from which on a link's centre of mass is asked about: of lighter ones it hardly shows."""


@dataclass(frozen=True)
class Candidate:
    """An effect at a place. Its numbers are fitted as sizes x: 0 where the effect vanishes, 1 at the typical value; linear in the
    value, or in its inverse where it vanishes at infinity (a stiffness, a ceiling); of a number that only shapes an effect (the
    speed at which friction fades), whose neutral value is its typical one, x is the number of doublings."""

    effect: Effect
    where: tuple[str, ...]
    neutral: tuple[float, ...]

    @property
    def parameters(self) -> list[Parameter]:
        """The parameter behind each number; a vector has three."""
        return [p for p in self.effect.parameters for _ in range(3 if p.vector else 1)]

    def values(self, x: Sequence[float] | Array) -> list[float]:
        """Numbers in the contract's units, cut to what is possible."""
        out = []
        for p, n, size in zip(self.parameters, self.neutral, x):
            if math.isinf(n):
                value = p.typical / max(size, p.typical / p.high)
            else:
                value = n * 2.0**size if n == p.typical else n + size * (p.typical - n)
            out.append(float(np.clip(value, p.low, p.high)))
        return out

    def bounds(self) -> tuple[Array, Array]:
        """Of the sizes x."""
        low, high = [], []
        for p, n in zip(self.parameters, self.neutral):
            if n == p.typical:
                ends = [math.log2(end / n) for end in (p.low, p.high)]
            else:
                ends = [(end - n) / (p.typical - n) for end in (p.low, p.high)] if math.isfinite(n) else [0.0, p.typical / p.low]
            low.append(min(ends))
            high.append(max(ends))
        return np.array(low), np.array(high)

    @property
    def _probed(self) -> list[int]:
        """Numbers that show from neutral on: not those that shape an effect, nor a vector that says where a scalar acts."""
        scalar = any(not p.vector for p in self.effect.parameters)
        return [i for i, (p, n) in enumerate(zip(self.parameters, self.neutral)) if n != p.typical and not (scalar and p.vector)]

    def probes(self) -> list[Array]:
        """Sizes at which each probed number alone is typical; one empty for an effect without numbers."""
        n = len(self.neutral)
        return [np.eye(n)[i] for i in self._probed] or [np.zeros(n)]

    def start(self, probed: Array) -> Array:
        """Sizes within bounds to start a fit from, given those of the probed numbers."""
        x = np.zeros(len(self.neutral))
        x[self._probed] = probed[:len(self._probed)]
        return np.asarray(np.clip(x, *self.bounds()))

    def probed(self, x: Array) -> Array:
        """Of sizes x, those that were probed; one for an effect without numbers, which is there or not."""
        return x[self._probed] if len(x) else np.ones(1)

    def spec(self, x: Sequence[float] | Array) -> EffectSpec:
        """The effect at these sizes."""
        rest = iter(self.values(x))
        parameters: dict[str, float | tuple[float, float, float]] = {}
        for p in self.effect.parameters:
            parameters[p.name] = (next(rest), next(rest), next(rest)) if p.vector else next(rest)
        return EffectSpec(self.effect.name, self.where, parameters)

    def __str__(self) -> str:
        return f"{self.effect.name}({','.join(self.where)})"


def candidates(model: RobotModel, evidence: Sequence[TakeEvidence]) -> list[Candidate]:
    """All that this installation knows and these takes could show: at seen joints; what the ground does, in free takes."""
    seen = [j for j in model.joints if any(j in e.channels for e in evidence)]
    free = any(e.take.spec.base == "free" for e in evidence)
    out = []
    for effect in known_effects().values():
        if effect.layer == "measurement" or (effect.layer == "ground" and not free and effect.name != "ground_tilt"):
            continue
        if effect.name == "speed_order" and set(model.bus_ids) < set(model.joints):
            continue
        neutral = effect.neutral(model)
        if _searchable(effect, neutral):
            out += [Candidate(effect, where, neutral) for where in _places(effect, model, seen)]
    return out


def _searchable(effect: Effect, neutral: Sequence[float]) -> bool:
    """Whether a search from neutral can find it: not a stop, which shows nothing until the joint meets it, nor a mount whose
    axis has to be known first."""
    return effect.name != "loose_mount" and -math.inf not in neutral


def _places(effect: Effect, model: RobotModel, seen: Sequence[str]) -> Iterable[tuple[str, ...]]:
    masses = model.kinematics.masses
    heavy = [link for link in model.kinematics.links if masses[link] >= HEAVY * sum(masses.values())]
    if effect.layer == "inertia" and all(p.vector for p in effect.parameters):
        yield from ((link,) for link in heavy)
        return
    frames, feet = model.kinematics.frames, [f for f in foot_points(model.path) if f in seen]
    links: Sequence[str] = model.kinematics.links
    if effect.layer == "structure":  # what hangs on a joint and carries the next, or a foot
        carrying = {f.parent for f in frames.values()} | {frames[f].child for f in feet}
        links = [f.child for f in frames.values() if f.child in carrying]
    names = {"joint": seen, "foot": feet, "link": links, "rigid_body": list(model.rigid_bodies)}
    for place in effect.places:
        yield from [()] if place == "robot" else [(name,) for name in names[place]]
