"""The machine itself and the floor under it: effects on links, joints, feet and surroundings (docs/formats.md, section 7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from studies.other_engine.description import Description, LinkPart, SeriesJoint, Surroundings
from studies.other_engine.hidden.values import angle, number, vector
from workbench.robot import EffectSpec
from workbench.types import Array

LOSS = 1e-3
"""Damping of a compliant gear over its stiffness [s]: a twentieth of critical at 100 rad/s. The contract leaves it open."""
RATTLE = 1e-4
"""Viscous friction of play [N m s/rad]: grease."""

Build = Callable[[Description, EffectSpec], Description]
Around = Callable[[Surroundings, EffectSpec], Surroundings]


def backlash(robot: Description, spec: EffectSpec) -> Description:
    """Between servo and link, half the gap to each side of their agreeing."""
    half = angle(spec, "gap") / 2
    return _joints(robot, spec, lambda l: _in_series(l, SeriesJoint(f"{l.joint}/play", l.axis, half, 0.0, RATTLE)))


def joint_compliance(robot: Description, spec: EffectSpec) -> Description:
    """Between servo and link, a spring."""
    k = number(spec, "stiffness")
    return _joints(robot, spec, lambda l: _in_series(l, SeriesJoint(f"{l.joint}/twist", l.axis, np.inf, k, LOSS * k)))


def loose_mount(robot: Description, spec: EffectSpec) -> Description:
    """The link rattles about an axis (in its own frame) through its joint, between servo and link."""
    half, axis = angle(spec, "play") / 2, vector(spec, "axis")
    axis = axis / np.linalg.norm(axis)
    return _joints(robot, spec, lambda l: _in_series(l, SeriesJoint(f"{l.joint}/mount", axis, half, 0.0, RATTLE)))


def joint_stop(robot: Description, spec: EffectSpec) -> Description:
    """The servo's shaft ends there, or earlier if the description sets a limit."""
    lower, upper = angle(spec, "lower"), angle(spec, "upper")
    return _joints(robot, spec, lambda l: replace(l, lower=max(l.lower, lower), upper=min(l.upper, upper)))


def zero_offset(robot: Description, spec: EffectSpec) -> Description:
    """At the servo's zero the link is turned."""
    def turn(link: LinkPart) -> LinkPart:
        R = link.R @ Rotation.from_rotvec(angle(spec, "angle") * link.axis).as_matrix()
        return replace(link, R=R, p=link.p + (link.R - R) @ link.anchor)
    return _joints(robot, spec, turn)


def parallel_spring(robot: Description, spec: EffectSpec) -> Description:
    """From link to link, past servo and play."""
    return _joints(robot, spec, lambda l: replace(l, spring=l.spring + number(spec, "stiffness")))


def link_length(robot: Description, spec: EffectSpec) -> Description:
    """The next joint, or the feet of a last link, farther along the line from the link's own joint."""
    for name in spec.where:
        link = robot.link(name)
        children = [c for c in robot.links if c.parent == name]
        if len(children) > 1 or not (children or link.shapes):
            raise ValueError(f"link_length: expected a link with one joint or foot after its own, got '{name}'")
        to = children[0].p + children[0].R @ children[0].anchor if children else np.mean([s.p for s in link.shapes], axis=0)
        along = number(spec, "change") * (to - link.anchor) / np.linalg.norm(to - link.anchor)
        if children:
            robot = robot.with_link(replace(children[0], p=children[0].p + along))
        else:
            robot = robot.with_link(replace(link, shapes=tuple(replace(s, p=s.p + along) for s in link.shapes)))
    return robot


def payload(robot: Description, spec: EffectSpec) -> Description:
    """A point of mass, whose inertia about the common centre of mass is the parallel-axis theorem's."""
    added, at = number(spec, "mass"), vector(spec, "position")

    def load(link: LinkPart) -> LinkPart:
        mass = link.mass + added
        com = (link.mass * link.com + added * at) / mass
        inertia = link.inertia + _point(link.mass, link.com - com) + _point(added, at - com)
        return replace(link, mass=mass, com=com, inertia=inertia)
    return _links(robot, spec, load)


def com_shift(robot: Description, spec: EffectSpec) -> Description:
    """Mass and inertia as they were, about a shifted centre."""
    return _links(robot, spec, lambda l: replace(l, com=l.com + vector(spec, "offset")))


def foot_friction(robot: Description, spec: EffectSpec) -> Description:
    """Of the shapes of the link below a knee."""
    value = number(spec, "friction")
    return _joints(robot, spec, lambda l: replace(l, shapes=tuple(replace(s, pair_friction=value) for s in l.shapes)))


def soft_ground(robot: Description, spec: EffectSpec) -> Description:
    """Each contact point, foot and ground together."""
    value = number(spec, "stiffness")
    shapes = {l.name: tuple(replace(s, pair_stiffness=value) for s in l.shapes) for l in robot.links}
    return replace(robot, links=tuple(replace(l, shapes=shapes[l.name]) for l in robot.links))


def ground_friction(around: Surroundings, spec: EffectSpec) -> Surroundings:
    """Applies to every foot without a value of its own."""
    return replace(around, friction=number(spec, "friction"))


def ground_tilt(around: Surroundings, spec: EffectSpec) -> Surroundings:
    """Seen from the side, gravity leans by `forward`, and from behind by `left`."""
    down = np.array([np.tan(angle(spec, "forward")), np.tan(angle(spec, "left")), -1.0])
    return replace(around, gravity=9.81 * down / np.linalg.norm(down))


def tether_force(around: Surroundings, spec: EffectSpec) -> Surroundings:
    """Steady, from before the first command on."""
    return replace(around, tether=around.tether + vector(spec, "force"))


ROBOT: dict[str, Build] = {
    "backlash": backlash, "joint_compliance": joint_compliance, "loose_mount": loose_mount, "joint_stop": joint_stop,
    "zero_offset": zero_offset, "parallel_spring": parallel_spring, "link_length": link_length, "payload": payload,
    "com_shift": com_shift, "foot_friction": foot_friction, "soft_ground": soft_ground,
}
AROUND: dict[str, Around] = {
    "ground_friction": ground_friction, "ground_tilt": ground_tilt, "tether_force": tether_force,
}


def _joints(robot: Description, spec: EffectSpec, change: Callable[[LinkPart], LinkPart]) -> Description:
    for joint in spec.where:
        robot = robot.with_link(change(robot.child_of(joint)))
    return robot


def _links(robot: Description, spec: EffectSpec, change: Callable[[LinkPart], LinkPart]) -> Description:
    for name in spec.where:
        robot = robot.with_link(change(robot.link(name)))
    return robot


def _in_series(link: LinkPart, joint: SeriesJoint) -> LinkPart:
    return replace(link, series=(*link.series, joint))


def _point(mass: float, r: Array) -> Array:
    return np.asarray(mass * (np.dot(r, r) * np.eye(3) - np.outer(r, r)), dtype=float)
