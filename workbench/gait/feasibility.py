"""Limits that rule a request out before any search."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from workbench.dynamics import RobotTrajectory
from workbench.files import InputError
from workbench.gait.limits import Margin
from workbench.gait.machine import GaitMachine
from workbench.gait.request import Request
from workbench.gait.shape import KNEES, GaitShape
from workbench.gait.space import in_range, random_shape, space_of, tightest_arc
from workbench.gait.table import paths_of
from workbench.types import Array

STANDING = "RMS torque of standing still"
WITHOUT_NEAREST = ("slope", STANDING)
"""Limits beside which there is no nearest table."""
ABSURD = 10.0
"""Use of a limit beyond which a request is a slip of the pen, and nobody waits for the nearest gait."""
CROUCHES = (0.0, 0.05, 0.15, 0.3, 0.45)
"""By leg length, in which standing still is tried."""
HELD = 0.5
"""Share of the torque of standing still that the friction of servos at rest may hold instead of their motors."""
PATHS = 400
"""Random foot paths among which one must be possible."""
ARC_FROM_STRAIGHT = 0.1
"""Least curvature of an arc, by the drift that a straight gait may have: no gait keeps a radius that well."""
CARRIED = 0.6
"""Share of the required speed that a foot path must have: a body is carried on in the air and slides, too; small trots went half
as fast again as their feet."""


def out_of_reach(machine: GaitMachine, request: Request) -> Margin | None:
    """The first limit that no gait can meet: a speed beyond the feet's at the servos' no-load speed, or that no path of feet has
    within the ranges and speeds of joints; a slope beyond friction; a torque limit below the torque of standing. InputError for a
    limit on torque above the torque of the servos, and for an arc tighter than any stride, or as good as straight."""
    _check_arc(machine, request)
    most = float(machine.law.full_torque.max())
    if request.limits.rms is not None and request.limits.rms > most:
        raise InputError(None, f"RMS torque: expected at most {most:.3g} N m, the servos' torque at full duty, "
                               f"got {request.limits.rms:g}")
    for margin in (_foot_speed(machine, request), _slope(machine, request), _standing_torque(machine, request)):
        if margin is not None and margin.use > 1:
            return margin
    return _path(machine, request)


def has_nearest(impossible: Margin) -> bool:
    """Whether a request that exceeds this limit is answered with the nearest table."""
    return impossible.name not in WITHOUT_NEAREST and impossible.use <= ABSURD


def _check_arc(machine: GaitMachine, request: Request) -> None:
    if request.radius is None:
        return
    least, most = tightest_arc(machine), 1 / (ARC_FROM_STRAIGHT * request.limits.drift)
    if not least <= request.radius <= most:
        raise InputError(None, f"radius of an arc: expected {least:.3f} to {most:.0f} m on this robot, got {request.radius:g}; "
                               + ("tighter is a turn in place" if request.radius < least else "wider is straight ahead"))


def _foot_speed(machine: GaitMachine, request: Request) -> Margin | None:
    if request.speed is None:
        return None
    no_load = machine.law.line.no_load_speed
    legs = {leg.foot: max(float(no_load[i]) for i in map(machine.model.joints.index, leg.joints))
            for leg in machine.legs}
    fastest = min(2 * legs[leg.foot] * leg.length for leg in machine.legs)  # two joints of a leg that add up
    if request.way == "turn":
        fastest /= min(float(np.hypot(*leg.neutral[:2])) for leg in machine.legs)
    return Margin("foot speed", "servos at no load", request.speed, fastest, request.unit, request.speed / fastest)


def _slope(machine: GaitMachine, request: Request) -> Margin | None:
    friction = machine.model.ground.friction
    if friction is None:
        return None
    slope, bound = math.degrees(abs(request.slope)), math.degrees(math.atan(friction))
    return Margin("slope", f"friction {friction:g}", slope, bound, "deg", slope / bound, kind="slope")


def _standing_torque(machine: GaitMachine, request: Request) -> Margin | None:
    """Least over crouches and knees of the largest static torque, as far as friction does not hold it."""
    if request.limits.rms is None:
        return None
    least, where = math.inf, ""
    for knees in KNEES[:1] if request.built_knees else KNEES:
        for crouch in CROUCHES:
            shape = GaitShape("trot", knees, crouch=crouch * machine.leg_length)
            q, off, _ = machine.angles(shape, np.array([0.0]), 0.0)
            if off.max() > request.limits.reach:
                continue
            torque = np.abs(_static(machine, q))
            if torque.max() < least:
                least, where = float(torque.max()), machine.model.joints[int(np.argmax(torque))]
    needed = HELD * least
    return None if not where else Margin(STANDING, where, needed, request.limits.rms, "N m", needed / request.limits.rms)


def _static(machine: GaitMachine, q: Array) -> Array:
    """Torque (n,) [N m] of standing still at q (1, n) [rad], all feet down."""
    rows = np.repeat(q, 3, axis=0)
    still, time = np.zeros_like(rows), np.array([0.0, 0.1, 0.2])
    height = -min(float(leg.neutral[2]) for leg in machine.legs)
    trajectory = RobotTrajectory(time, machine.model.joints, rows, still, still, np.tile([0, 0, height], (3, 1)),
                                 np.tile([1.0, 0, 0, 0], (3, 1)), np.zeros((3, 6)), np.zeros((3, 6)))
    down = {leg.foot: np.ones(3, dtype=bool) for leg in machine.legs}
    return np.asarray(machine.inverse_dynamics.of(trajectory, down).torque[1])


def _path(machine: GaitMachine, request: Request) -> Margin | None:
    """Whether any of PATHS random foot paths at the required speed stays within ranges and servo speeds; else the least that one
    asks of a joint's speed."""
    if request.speed is None:
        return None
    space, rng = space_of(machine, request), np.random.default_rng(30)
    shapes = [_at_speed(random_shape(rng, request, space), request) for _ in range(PATHS)]
    fastest = machine.fastest * machine.speed_unit
    best: Margin | None = None
    for p in paths_of(machine, shapes):
        if p.off.max() > request.limits.reach or not in_range(machine, p):
            continue
        dwell = p.shape.period / p.shape.poses
        use = np.abs(p.q - np.roll(p.q, 1, axis=0)).max(axis=0) / dwell / fastest
        j = int(np.argmax(use))
        margin = Margin("speed of a joint on its foot's path", machine.model.joints[j], float(use[j] * fastest[j]),
                        float(fastest[j]), "rad/s", float(use[j]))
        if margin.use <= 1:
            return None
        best = margin if best is None or margin.use < best.use else best
    return best or Margin("foot paths", f"of {PATHS} tried", 0.0, 1.0, "within reach, at least", 2.0)


def _at_speed(shape: GaitShape, request: Request) -> GaitShape:
    """The shape with strides that give CARRIED of the required speed, even beyond the space."""
    assert request.speed is not None
    gone = CARRIED * request.speed * shape.duty * shape.period  # in a stance
    if request.way == "turn":
        return replace(shape, turn=request.side * gone)
    if request.way == "sideways":
        return replace(shape, side=request.side * gone)
    if request.radius is not None:
        return replace(shape, stride=gone, turn=request.side * gone / request.radius)
    return replace(shape, stride=-gone if request.way == "backward" else gone)
