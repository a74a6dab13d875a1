"""Every effect at every place where it could act and where these takes could show it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect, Parameter
from workbench.effects.registry import known_effects
from workbench.effects.sdf import SdfRobot
from workbench.gap.evidence import TakeEvidence
from workbench.gap.footfalls import foot_points
from workbench.robot import EffectSpec, RobotModel

Array = NDArray[np.float64]

HEAVY = 0.15
"""Share of the robot's mass from which on a link's centre of mass is asked about: of lighter ones it hardly shows."""
LEAST_MASS, MOST_MOMENT = 0.05, 100.0
"""Of a point mass, in typical masses and moments: what positions are divided by at least, and how far moments go."""
LENGTH = 0.5
"""Share of a link's length by which the search changes it at most."""
AWAY = 2.5
"""Typical distances from a link's centre of mass at which a point mass is probed, along each axis."""
ASKED_APART = ("loose_mount", "joint_stop", "marker_frame", "dropped_command")
"""What a search from neutral cannot find: a stop shows nothing until the joint meets it, a mount's axis has to be known first;
`special` reads them off the recordings."""


@dataclass(frozen=True)
class Candidate:
    """An effect at a place. Its numbers are fitted as sizes x: 0 where the effect vanishes, 1 at the typical value; linear in the
    value, or in its inverse where it vanishes at infinity (a stiffness, a ceiling); of a number that only shapes an effect (the
    speed at which friction fades) x is the number of doublings. held: by number,
    whether it is no matter of fitting (an axis that was read off the recording)."""

    effect: Effect
    where: tuple[str, ...]
    neutral: tuple[float, ...]
    typical: tuple[float, ...]
    held: tuple[bool, ...]
    reach: float = math.inf

    @staticmethod
    def of(effect: Effect, where: tuple[str, ...], neutral: Sequence[float], typical: Sequence[float] | None = None,
           held: Sequence[bool] | None = None) -> Candidate:
        """typical: default the effect's own."""
        own = tuple(p.typical_beside(n) for p, n in zip(_by_number(effect), neutral))
        return Candidate(effect, where, tuple(neutral), tuple(typical or own), tuple(held or (False,) * len(own)))

    @property
    def name(self) -> str:
        return self.effect.name

    @property
    def key(self) -> tuple[str, tuple[str, ...]]:
        """What it is and where."""
        return self.effect.name, self.where

    @property
    def joint(self) -> str | None:
        """The one joint in which it acts."""
        return self.where[0] if "joint" in self.effect.places and len(self.where) == 1 else None

    @property
    def read_off(self) -> bool:
        """Whether its sizes were read off the recordings, 1 being what they say."""
        return self.effect.name in ASKED_APART

    @property
    def parameters(self) -> list[Parameter]:
        """The parameter behind each number; a vector has three."""
        return _by_number(self.effect)

    @property
    def size(self) -> int:
        """How many numbers are fitted."""
        return self.held.count(False)

    @property
    def shapes(self) -> NDArray[np.bool_]:
        """Of the sizes, those of numbers that only shape the effect."""
        return np.array([p.shapes for p, held in zip(self.parameters, self.held) if not held], dtype=bool)

    def values(self, x: Sequence[float] | Array) -> list[float]:
        """Numbers in the contract's units, cut to what is possible; x: of those that are fitted."""
        x = np.asarray(x, dtype=float)
        if self.point_mass:
            x = np.array([x[0], *(x[1:] / max(x[0], LEAST_MASS))])
        sizes = iter(x.tolist())
        out = []
        for p, n, t, held in zip(self.parameters, self.neutral, self.typical, self.held):
            size = 1.0 if held else next(sizes)
            if held:
                value = t
            elif math.isinf(n):
                value = t / max(size, t / p.high)
            else:
                value = n * 2.0**size if p.shapes else n + size * (t - n)
            out.append(float(np.clip(value, p.low, p.high)))
        return out

    def bounds(self) -> tuple[Array, Array]:
        """Of the sizes x."""
        low, high = [], []
        for p, n, t, held in zip(self.parameters, self.neutral, self.typical, self.held):
            if held:
                continue
            if math.isinf(n):
                ends = [0.0, t / p.low]
            elif p.shapes:
                ends = [math.log2(end / n) if end > 0 else -10.0 for end in (p.low, p.high)]
            else:
                ends = [(end - n) / (t - n) for end in (max(p.low, n - self.reach), min(p.high, n + self.reach))]
            low.append(min(ends))
            high.append(max(ends))
        if self.point_mass:
            low[1:], high[1:] = [-MOST_MOMENT] * 3, [MOST_MOMENT] * 3
        return np.array(low), np.array(high)

    def probes(self) -> list[Array]:
        """Sizes at which each number that shows from neutral on is alone typical: not those that shape an effect, nor a vector
        that says where a scalar acts; one empty for an effect without numbers."""
        if self.point_mass:
            return [np.array([1.0, *(AWAY * np.eye(4)[k, 1:])]) for k in range(4)]
        scalar = any(not p.vector for p in self.effect.parameters)
        fitted = [p for p, held in zip(self.parameters, self.held) if not held]
        shown = [i for i, p in enumerate(fitted) if not p.shapes and not (scalar and p.vector)]
        return [np.eye(self.size)[i] for i in shown] or [np.zeros(self.size)]

    def around(self) -> list[Array]:
        """Probes both ways and, of the first two, together: what a push to the left shows depends on that to the front. The same
        as probes where there is one."""
        probes, signs = self.probes(), (1.0, -1.0)
        if len(probes) < 2:
            return probes
        middle = probes.pop(0) if self.point_mass else np.zeros(self.size)
        ways = [p - middle for p in probes]
        return [*([middle] if self.point_mass else []), *(middle + s * way for s in signs for way in ways),
                *(middle + s * ways[0] + t * ways[1] for s in signs for t in signs)]

    @property
    def point_mass(self) -> bool:
        """Whether the sizes are a mass and where it is, all to be fitted: then as mass and its moments about the link's centre of
        mass, which show linearly, as mass and distance do not."""
        return self.effect.name == "payload" and self.size == 4

    def spec(self, x: Sequence[float] | Array) -> EffectSpec:
        """The effect at these sizes."""
        rest = iter(self.values(x))
        parameters: dict[str, float | tuple[float, float, float]] = {}
        for p in self.effect.parameters:
            parameters[p.name] = (next(rest), next(rest), next(rest)) if p.vector else next(rest)
        return EffectSpec(self.effect.name, self.where, parameters)

    def __str__(self) -> str:
        return f"{self.effect.name}({','.join(self.where)})"


def _by_number(effect: Effect) -> list[Parameter]:
    """The parameter behind each number; a vector has three."""
    return [p for p in effect.parameters for _ in range(3 if p.vector else 1)]


def candidates(model: RobotModel, evidence: Sequence[TakeEvidence]) -> list[Candidate]:
    """All that this installation knows and a search from neutral could find in these takes."""
    seen = [j for j in model.joints if any(j in e.channels for e in evidence)]
    free = any(e.take.spec.base == "free" for e in evidence)
    start_known = not any(e.start_is_free for e in evidence)
    sdf = SdfRobot(model.path)
    out: list[Candidate] = []
    for effect in known_effects().values():
        if effect.layer == "measurement" or (effect.layer == "ground" and not free and effect.name != "ground_tilt"):
            continue
        if effect.name in ASKED_APART or (effect.name == "zero_offset" and not free and _zeroed(evidence)):
            continue
        if effect.name == "speed_order" and (set(model.bus_ids) < set(model.joints) or len(model.joints) < 2):
            continue
        if effect.name == "speed_order" and not _speeds_are_set(evidence):
            continue
        neutral = effect.neutral(model)
        for where in _places(effect, model, seen):
            if effect.name == "command_delay" and not where and not start_known:
                continue  # a late start and a delay of all joints are the same
            candidate = Candidate.of(effect, where, *_at_rest(effect, model, where, neutral))
            if effect.name == "link_length":
                candidate = replace(candidate, reach=LENGTH * float(np.linalg.norm(sdf.way(model.kinematics, where[0]))))
            out.append(candidate)
    return out


def _speeds_are_set(evidence: Sequence[TakeEvidence]) -> bool:
    """Whether moving speeds went out on the bus in any take."""
    return any(e.take.commands is not None and np.any(e.take.commands.speeds > 0) for e in evidence)


def _zeroed(evidence: Sequence[TakeEvidence]) -> bool:
    return all(e.take.recorded.zeroed for e in evidence)


def _at_rest(effect: Effect, model: RobotModel, where: tuple[str, ...], neutral: tuple[float, ...]
             ) -> tuple[tuple[float, ...], tuple[float, ...] | None]:
    """Neutral and typical numbers; a mass is sought from its link's centre of mass on, not from its joint."""
    if effect.name != "payload":
        return neutral, None
    center = np.asarray(model.kinematics.centers.get(where[0], np.zeros(3)), dtype=float)
    mass, position = effect.parameters[0], effect.parameters[1]
    return (0.0, *center.tolist()), (mass.typical, *(center + position.typical).tolist())


def heavy_links(model: RobotModel) -> list[str]:
    """Links with at least the share HEAVY of the robot's mass."""
    masses = model.kinematics.masses
    return [link for link in model.kinematics.links if masses[link] >= HEAVY * sum(masses.values())]


def _places(effect: Effect, model: RobotModel, seen: Sequence[str]) -> Iterable[tuple[str, ...]]:
    heavy = heavy_links(model)
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


def with_effects(nominal: RobotModel, effects: Sequence[tuple[Candidate, Array]]) -> RobotModel:
    """The nominal robot with effects of given sizes, one after the other."""
    return replace(nominal, effects=(*nominal.effects, *(c.spec(x) for c, x in effects)))
