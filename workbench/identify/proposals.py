"""Every effect at every place where it could act and where these takes could show it; and those that they cannot show, whatever
the robot is like, and why: what their absence from the findings does not mean."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np

from workbench.dynamics.machine import Machine
from workbench.dynamics.trajectory import RobotTrajectory
from workbench.effects.base import Effect
from workbench.effects.registry import known_effects
from workbench.effects.sdf import SdfRobot
from workbench.identify.options import PROBLEM
from workbench.identify.parameters import Candidate
from workbench.identify.point_mass import point_mass
from workbench.identify.problem import TakeEvidence
from workbench.identify.rollouts.servo_logs import is_log
from workbench.robot import RobotModel
from workbench.types import Array

HELD = "the base was held in every take"
NO_CAMERA = "only cameras can see it, and the takes are servo logs"
NO_COMMAND = "these servos and commands never excite it"
NO_START = "a later start of the take looks the same, and no take states when it started"
NO_LOAD = "gravity loads none of the joints"


def candidates(model: RobotModel, evidence: Sequence[TakeEvidence], unloaded: Collection[str] = ()) -> list[Candidate]:
    """Every known effect at every place where it could act, these takes could show it and a search from neutral find it.
    unloaded: joints that nothing loads in these takes (`unloaded_joints`)."""
    seen = [j for j in model.joints if any(j in e.channels for e in evidence)]
    free = any(e.take.spec.base == "free" for e in evidence)
    zeroed = all(e.take.recorded.zeroed for e in evidence)
    start_known = not any(e.start_is_free for e in evidence)
    sdf = SdfRobot(model.path)
    out: list[Candidate] = []
    sent = [e.take.commands for e in evidence if e.take.commands is not None]
    for effect in known_effects().values():
        if effect.layer == "measurement" or not effect.from_neutral or not effect.could_act(model, sent):
            continue
        if not free and (not effect.observable_when_fixed or (effect.hidden_by_zeroing and zeroed)):
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


def heavy_links(model: RobotModel) -> list[str]:
    """Links with at least the share `ProblemOptions.heavy` of the robot's mass, `heavy_trunk` where they are no part of one
    leg."""
    k = model.kinematics
    feet = list(model.foot_links.values())
    carried = Counter(link for foot in feet for link in (foot, *k.ancestors(foot)))
    return [link for link in k.links
            if k.masses[link] >= k.mass * (PROBLEM.heavy_trunk if feet and carried[link] != 1 else PROBLEM.heavy)]


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


def unloaded_joints(model: RobotModel, evidence: Sequence[TakeEvidence]) -> set[str]:
    """Joints of a held robot that gravity loads by less than `PROBLEM.loaded` of their dry friction in every pose of these logs;
    empty where any take is not a servo log, as a floor or a hand may load any joint then."""
    if not evidence or not all(is_log(e) for e in evidence) or model.base != model.kinematics.root:
        return set()
    most = np.zeros(len(model.joints))
    for e in evidence:
        most = np.maximum(most, steady_loads(e.take.spec.robot(model), e))
    return {j for j, load in zip(model.joints, most) if load < PROBLEM.loaded * model.servo(j).coulomb_friction}


def steady_loads(model: RobotModel, e: TakeEvidence) -> Array:
    """The largest torque of gravity on each joint (n,) [N m] over a sample of the poses that a log shows. A joint that was not
    logged is taken to be at zero."""
    recorded = e.take.recorded
    rows = np.unique(np.linspace(0, len(recorded.time) - 1, PROBLEM.poses_sampled).astype(int))
    q = np.zeros((len(rows), len(model.joints)))
    for joint in recorded.joints:
        q[:, model.joints.index(joint)] = np.nan_to_num(recorded.q[rows, recorded.column(joint)])
    _, torques = Machine(model).demand(RobotTrajectory.at_rest(model.joints, q))
    return np.asarray(np.max(np.abs(torques), axis=0))


def unobservable(model: RobotModel, evidence: Sequence[TakeEvidence], unloaded: Collection[str] = ()) -> dict[str, str]:
    """Why these takes cannot show an effect at any place, by effect; under "still joints", those that no take moves. unloaded:
    joints that nothing loads in these takes (`unloaded_joints`)."""
    if not evidence:
        return {}
    logs = all(is_log(e) for e in evidence)
    held = all(e.take.spec.base == "fixed" for e in evidence)
    moving = {j for e in evidence for j in e.channels if j in model.joints and _moves(e, j)}
    out = {}
    for name, effect in known_effects().items():
        reason = _reason(effect, model, evidence, held, logs, set(model.joints) <= set(unloaded))
        if reason:
            out[name] = reason
    if held:
        out |= {f"{name} at {model.base}": HELD for name, e in known_effects().items() if e.point_mass or e.moves_center}
    still = [j for j in model.joints if j not in moving]
    if still:
        out["anything at " + ", ".join(still)] = f"no take moves {'it' if len(still) == 1 else 'them'}"
    return out


def _reason(effect: Effect, model: RobotModel, evidence: Sequence[TakeEvidence], held: bool, logs: bool, unloaded: bool) -> str:
    sent = [e.take.commands for e in evidence if e.take.commands is not None]
    if logs and (effect.layer == "measurement" or "rigid_body" in effect.places):
        return NO_CAMERA
    if held and not effect.observable_when_fixed:
        return HELD
    if logs and effect.free_play and not effect.from_neutral:
        return NO_CAMERA
    if not effect.could_act(model, sent):
        return NO_COMMAND
    if effect.like_a_late_start and effect.places == ("robot",) and any(e.start_is_free for e in evidence):
        return NO_START
    return NO_LOAD if effect.needs_steady_load and unloaded else ""


def _moves(e: TakeEvidence, joint: str) -> bool:
    column = e.recorded[:, e.channels.index(joint)]
    seen = column[np.isfinite(column)]
    return bool(len(seen) and np.ptp(seen) > PROBLEM.still)
