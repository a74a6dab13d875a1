"""Finds places and sizes at which effects show, one by one, and at which one masks the others on the body's path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from studies.concealed_effects.catalogue import PULLS, TIES, Draw, draw
from studies.concealed_effects.robots import Robot
from studies.concealed_effects.takes import LogPlan
from studies.concealed_effects.visible import COARSE, FINE, SHOWS, Seen, excess, see
from studies.other_engine.firmware import commands_from_rows
from studies.other_engine.make_session import TakePlan
from studies.other_engine.player import play
from workbench.robot import EffectSpec, RobotModel

TRIES = 40
MISSED = 0.12
"""Share of the nominal way that the other effects have to change for there to be something to mask."""
MASKED = 0.05
"""Share to which the mask brings that down, while it is looked for; twice that in the recording itself."""
LEAST_WAY = 0.02
"""Change of the way that there has to be at least [m]."""

Takes = Sequence[TakePlan] | Sequence[LogPlan]


class NoneFoundError(Exception):
    """No place and size was found at which this hides as asked; another draw may do."""


@dataclass
class Bench:
    """A nominal robot and its takes, with the motions played so far."""

    robot: Robot
    model: RobotModel
    takes: Takes
    nominal: dict[str, Seen] = field(default_factory=dict)
    _finer: dict[str, Seen] = field(default_factory=dict)
    _seen: dict[tuple[str, str], Seen] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for take in self.takes:
            self.nominal[take.name] = see(self.model, take)

    def finer(self, take: TakePlan | LogPlan) -> Seen | None:
        """A take on the ground at half the step; None for others, which are the same at any."""
        if isinstance(take, LogPlan) or take.base != "free":
            return None
        if take.name not in self._finer:
            self._finer[take.name] = see(self.model, take, FINE)
        return self._finer[take.name]

    def seen(self, effects: Sequence[EffectSpec], take: TakePlan | LogPlan) -> Seen:
        """A take of the robot with these effects."""
        key = repr(tuple(effects)), take.name
        if key not in self._seen:
            self._seen[key] = see(replace(self.model, effects=tuple(effects)), take)
        return self._seen[key]

    @property
    def walk(self) -> TakePlan:
        """The take that goes somewhere."""
        (walk,) = [t for t in self.takes if t.name == "walk" and isinstance(t, TakePlan)]
        return walk

    @property
    def sound(self) -> bool:
        """Whether the nominal robot walks, upright."""
        return all(s.upright > 0.9 for s in self.nominal.values()) and (
            "walk" not in self.nominal or 0.06 < self.nominal["walk"].travel < 0.6)

    def with_effects(self, effects: Sequence[EffectSpec]) -> RobotModel:
        """The robot with these."""
        return replace(self.model, effects=tuple(effects))

    def shows(self, effect: EffectSpec) -> float:
        """How many times its noise the effect alone changes some channel of some take."""
        most = 0.0
        for take in self.takes:
            seen = self.seen([effect], take)
            if not np.isfinite(seen.upright) or seen.upright < 0.8:
                raise NoneFoundError(f"{effect.effect}: the robot falls")
            nominal = self.nominal[take.name]
            most = max(most, excess(seen, nominal, nominal, self.finer(take)))
            if most > SHOWS:  # more is not asked
                break
        return most

    def each_adds(self, effects: Sequence[EffectSpec]) -> bool:
        """Whether each is observable among the others: the robot without it, but with the rest, would be recorded differently."""
        left = list(effects) if len(effects) > 1 else []
        for take in self.takes:
            for e in tuple(left):
                without = self.seen([o for o in effects if o is not e], take)
                if excess(self.seen(effects, take), without, self.nominal[take.name], self.finer(take)) > SHOWS:
                    left.remove(e)
        return not left

    def way(self, effects: Sequence[EffectSpec], timestep: float = COARSE) -> float:
        """How far the robot walks [m]; NaN where it falls."""
        walk = self.walk
        commands = commands_from_rows(walk.motion.joints, walk.motion.times, walk.motion.angles, walk.cycles)
        run = play(self.with_effects(effects), commands, commands.end + 0.3, 0.01, walk.base, timestep)
        p, R = run.poses(np.array([0.0, run.time[-1]]), (self.model.base,))[self.model.base]
        return float(np.linalg.norm((p[1] - p[0])[:2])) if R[1, 2, 2] > 0.8 else float("nan")

    def stands(self, effects: Sequence[EffectSpec]) -> bool:
        """Whether the robot stays upright in all takes."""
        return all(self.seen(effects, t).upright > 0.8 for t in self.takes)


def conceal(bench: Bench, effects: Sequence[str], masked: bool, rng: np.random.Generator) -> tuple[EffectSpec, ...]:
    """Draws parameters for named effects until each is observable alone and among the others. NoneFoundError if no draw is."""
    failed: list[list[EffectSpec]] = []
    for _ in range(4):
        chosen: list[EffectSpec] = []
        for name in effects[:-1] if masked else effects:
            chosen.append(_visible(bench, name, chosen, rng)[1])
        if masked:
            mask = _mask(bench, chosen, effects[-1], rng)
            if mask is None:
                continue
            chosen.append(mask)
        if chosen in failed:  # nothing about them can be drawn otherwise: another robot may do
            break
        if bench.stands(chosen) and bench.each_adds(chosen):
            return tuple(chosen)
        failed.append(chosen)
    raise NoneFoundError(f"{', '.join(effects)}: none of the draws hides as asked")


def _visible(bench: Bench, name: str, beside: Sequence[EffectSpec], rng: np.random.Generator) -> tuple[Draw, EffectSpec]:
    for _ in range(TRIES):
        drawn = draw(name, rng, bench.robot)
        spec = drawn.at(float(rng.uniform()))
        if separable(spec, beside):
            try:
                if bench.shows(spec) > SHOWS:
                    return drawn, spec
            except NoneFoundError:
                continue
    raise NoneFoundError(f"{name}: shows nowhere")


def separable(spec: EffectSpec, beside: Sequence[EffectSpec]) -> bool:
    """Whether an effect can be hidden with others: none of them is at the same joint (play inside a stop, say, is not defined),
    and it forms no pair with one of them that nothing can separate."""
    taken = {_joint(w) for e in beside for w in e.where}
    if any(frozenset((spec.effect, e.effect)) in TIES for e in beside):
        return False
    return not taken & {_joint(w) for w in spec.where} and spec.effect not in {e.effect for e in beside}


def _joint(place: str) -> str:
    return place.removesuffix("_link")


def _mask(bench: Bench, chosen: Sequence[EffectSpec], name: str, rng: np.random.Generator) -> EffectSpec | None:
    """An effect, the drawn one or, if that cannot, another that pulls, at the size that brings the way walked back to nominal."""
    nominal = bench.nominal["walk"].travel
    missed = bench.way(chosen) - nominal
    if not abs(missed) > max(MISSED * nominal, LEAST_WAY):
        return None
    others = [str(n) for n in rng.permutation(PULLS)]
    for candidate in dict.fromkeys([name, *others]):
        drawn = draw(candidate, rng, bench.robot)
        if not separable(drawn.at(0.5), chosen):
            continue
        spec = _sized(bench, chosen, drawn, nominal, missed)
        if spec is not None:
            return spec
    return None


def _sized(bench: Bench, chosen: Sequence[EffectSpec], drawn: Draw, nominal: float, missed: float) -> EffectSpec | None:
    """The drawn effect at a size for which the way is nominal, in the recording's own step, too; None if there is none."""
    if drawn.has_sign and (bench.way([*chosen, drawn.at(0.7)]) - nominal - missed) * missed > 0:
        drawn = drawn.flipped()  # it pulls the same way as the others
    shares = [0.0, 1.0]
    ways = [bench.way([*chosen, drawn.at(s)]) - nominal for s in shares]
    for _ in range(5):
        best = int(np.argmin(np.abs(np.nan_to_num(ways, nan=np.inf))))
        if abs(ways[best]) < MASKED * nominal:
            spec, finer = drawn.at(shares[best]), bench.finer(bench.walk)
            assert finer is not None
            good = abs(bench.way([*chosen, spec], FINE) - finer.travel) < 2 * MASKED * nominal
            try:
                return spec if good and bench.shows(spec) > SHOWS else None
            except NoneFoundError:
                return None
        crossings = [i for i in range(len(ways) - 1) if ways[i] * ways[i + 1] < 0]
        if not crossings:
            return None
        i = crossings[0]
        between = np.clip(ways[i] / (ways[i] - ways[i + 1]), 0.15, 0.85)  # regula falsi, kept off the ends
        shares.insert(i + 1, shares[i] + float(between) * (shares[i + 1] - shares[i]))
        ways.insert(i + 1, bench.way([*chosen, drawn.at(shares[i + 1])]) - nominal)
    return None
