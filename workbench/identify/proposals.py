"""Every effect at every place where it could act and where these takes could show it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

from workbench.effects.base import Effect
from workbench.effects.registry import known_effects
from workbench.effects.sdf import SdfRobot
from workbench.identify.options import PROBLEM
from workbench.identify.parameters import Candidate
from workbench.identify.point_mass import point_mass
from workbench.identify.problem import TakeEvidence
from workbench.robot import RobotModel


def candidates(model: RobotModel, evidence: Sequence[TakeEvidence], unloaded: Collection[str] = ()) -> list[Candidate]:
    """Every known effect at every place where it could act, these takes could show it and a search from neutral find it.
    unloaded: joints that nothing loads in these takes (`unloaded_joints`)."""
    seen = [j for j in model.joints if any(j in e.channels for e in evidence)]
    free = any(e.take.spec.base == "free" for e in evidence)
    start_known = not any(e.start_is_free for e in evidence)
    sdf = SdfRobot(model.path)
    out: list[Candidate] = []
    sent = [e.take.commands for e in evidence if e.take.commands is not None]
    for effect in known_effects().values():
        if effect.layer == "measurement" or not effect.from_neutral or not effect.could_act(model, sent):
            continue
        if not free and (not effect.observable_when_fixed or (effect.hidden_by_zeroing and _is_zeroed(evidence))):
            continue
        neutral = effect.neutral(model)
        for where in _places(effect, model, seen):
            late = effect.like_a_late_start and not where and not start_known
            if late or (effect.needs_steady_load and where and set(where) <= set(unloaded)):
                continue
            if effect.point_mass:
                out.append(point_mass(effect, where[0], model.kinematics, base_is_held=not free))
            else:
                c = Candidate.of(effect, where, neutral, lowest=effect.lowest(model, where))
                out.append(replace(c, reach=effect.reach(sdf, model, where)))
    return out


def _is_zeroed(evidence: Sequence[TakeEvidence]) -> bool:
    return all(e.take.recorded.zeroed for e in evidence)


def heavy_links(model: RobotModel) -> list[str]:
    """Links with at least the share `ProblemOptions.heavy` of the robot's mass, `heavy_trunk` where they are no part of one
    leg."""
    k = model.kinematics
    feet = list(model.foot_links.values())
    carried = Counter(link for foot in feet for link in (foot, *k.ancestors(foot)))
    return [
        link
        for link in k.links
        if k.masses[link] >= k.mass * (PROBLEM.heavy_trunk if feet and carried[link] != 1 else PROBLEM.heavy)
    ]


def _places(effect: Effect, model: RobotModel, seen: Sequence[str]) -> Iterable[tuple[str, ...]]:
    if effect.moves_center:
        yield from ((link,) for link in heavy_links(model))
        return
    frames, feet = model.kinematics.frames, [f for f in model.foot_links if f in seen]
    links: Sequence[str] = model.kinematics.links
    if effect.layer == "structure":  # what hangs on a joint and carries the next, or a foot
        carrying = {f.parent for f in frames.values()} | {model.foot_links[f] for f in feet}
        links = [f.child for f in frames.values() if f.child in carrying]
    names = {"joint": seen, "foot": feet, "link": links, "rigid_body": list(model.rigid_bodies)}
    for place in effect.places:
        yield from [()] if place == "robot" else [(name,) for name in names[place]]
