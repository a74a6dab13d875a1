"""A planned gait compared with its simulated table: base, feet, joints and every tracked body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.gait.legs import Leg
from workbench.gait.machine import GaitMachine
from workbench.gait.table import GaitTable
from workbench.gait.trajopt import Planned
from workbench.recording import quaternions as quat
from workbench.recording.take import Take
from workbench.types import Array


@dataclass(frozen=True)
class BodyError:
    """RMS over a cycle between a planned body and the simulated one, both seen from the frame that goes as planned. position [m],
    rotation [rad]."""

    position: float
    rotation: float


@dataclass(frozen=True, eq=False)
class Motion:
    """Over one cycle, at K phases, in the frame that goes along. p (K, 3) [m], R (K, 3, 3): of the base; q (K, n) [rad]; feet
    (K, F, 3) [m]; bodies: tracked asset -> (p, R)."""

    p: Array
    R: Array
    q: Array
    feet: Array
    bodies: Mapping[str, tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class PlanComparison:
    """planned, simulated: over one cycle. errors: of each tracked body, by asset. joints: RMS [rad] of each of the model's.
    feet: RMS [m] of each foot's tip. speed: simulated by planned. phases: (K,) shares of the cycle."""

    planned: Motion
    simulated: Motion
    phases: Array
    errors: Mapping[str, BodyError]
    joints: Mapping[str, float]
    feet: Mapping[str, float]
    speed: float


def compare_plan(machine: GaitMachine, planned: Planned, table: GaitTable, take: Take, cycles: int) -> PlanComparison:
    """Compares a plan with a run of its table from power-on. cycles: of the loop that the take holds; the first is left out.

    The planned frame goes at the planned speed; where it is in each cycle is chosen so that planned and simulated base agree on
    average, so that a slower robot shows as an error that grows within the cycle and not from cycle to cycle."""
    K = len(planned.q)
    ours = _planned_motion(machine, planned)
    every = [_simulated_cycle(machine, planned, take, table.start_seconds + c * table.period, table.period, K, ours)
             for c in range(1, cycles)]
    mean = {name: np.mean([getattr(m, name) for m in every], axis=0) for name in ("p", "R", "q", "feet")}
    theirs = Motion(mean["p"], mean["R"], mean["q"], mean["feet"],
                    {a: (np.mean([m.bodies[a][0] for m in every], axis=0), np.mean([m.bodies[a][1] for m in every], axis=0))
                     for a in ours.bodies})
    errors = {a: BodyError(_rms(np.concatenate([m.bodies[a][0] - ours.bodies[a][0] for m in every])),
                           float(np.sqrt(np.mean([_angle(m.bodies[a][1], ours.bodies[a][1]) ** 2 for m in every]))))
              for a in ours.bodies}
    joints = np.sqrt(np.mean([(m.q - ours.q) ** 2 for m in every], axis=(0, 1)))
    feet = {leg.foot: _rms(np.concatenate([m.feet[:, i] - ours.feet[:, i] for m in every]))
            for i, leg in enumerate(machine.legs)}
    return PlanComparison(ours, theirs, np.arange(K) / K, errors, dict(zip(machine.model.joints, joints.tolist())), feet,
                          _speed(planned, table, take, cycles))


def _rms(x: Array) -> float:
    """RMS length of vectors (N, 3)."""
    return float(np.sqrt((x**2).sum(axis=1).mean()))


def _angle(a: Array, b: Array) -> Array:
    """Between rotations (K, 3, 3) [rad]; of means of rotations, which are nearly ones."""
    trace = np.einsum("kij,kij->k", a, b)
    return np.asarray(np.arccos(np.clip((trace - 1) / 2, -1, 1)))


def _planned_motion(machine: GaitMachine, planned: Planned) -> Motion:
    height = -min(float(leg.neutral[2]) for leg in machine.legs)
    p = planned.p + np.array([0.0, 0.0, height])
    angle = np.linalg.norm(planned.tilt, axis=1)
    axis = planned.tilt / np.maximum(angle, 1e-12)[:, None]
    R = quat.matrix(np.column_stack([np.cos(angle / 2), np.sin(angle / 2)[:, None] * axis]))
    return _motion(machine, p, R, planned.q)


def _motion(machine: GaitMachine, p: Array, R: Array, q: Array) -> Motion:
    model = machine.model
    poses = model.kinematics.forward(q, model.joints)
    bodies = {asset: (p + np.einsum("kij,kj->ki", R, poses[link][0]), R @ poses[link][1])
              for asset, link in model.rigid_bodies.items() if link in poses}
    feet = np.stack([p + np.einsum("kij,kj->ki", R, _tip(leg, q, model.joints)) for leg in machine.legs], axis=1)
    return Motion(p, R, q, feet, bodies)


def _tip(leg: Leg, q: Array, joints: tuple[str, ...]) -> Array:
    return leg.place(q[:, [joints.index(j) for j in leg.joints]])


def _simulated_cycle(machine: GaitMachine, planned: Planned, take: Take, begin: float, period: float, K: int, ours: Motion
                     ) -> Motion:
    """One cycle of a take, from the frame that goes as planned."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    at = begin + period * np.arange(K) / K
    p = np.stack([np.interp(at, take.time, take.p_WB[:, i]) for i in range(3)], axis=1)
    q = np.stack([np.interp(at, take.time, take.q[:, take.joints.index(j)]) for j in machine.model.joints], axis=1)
    R = quat.matrix(quat.interpolate(take.time, take.quat_WB, at))
    elapsed = at - begin
    rate = planned.task.turn_rate
    heading = np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0])) - rate * elapsed
    yaw = float(heading.mean()) + rate * elapsed
    middle = yaw.mean()
    way = np.array([[np.cos(middle), -np.sin(middle)], [np.sin(middle), np.cos(middle)]])
    where = elapsed[:, None] * (way @ np.array(planned.task.velocity))
    c, s, o, one = np.cos(yaw), np.sin(yaw), np.zeros(K), np.ones(K)
    back = np.stack([np.stack([c, s, o], 1), np.stack([-s, c, o], 1), np.stack([o, o, one], 1)], axis=1)
    off = np.column_stack([p[:, :2] - where, o])
    local = np.einsum("kij,kj->ki", back, off - off.mean(axis=0))
    local[:, :2] += ours.p[:, :2].mean(axis=0)
    local[:, 2] = p[:, 2]
    return _motion(machine, local, back @ R, q)


def _speed(planned: Planned, table: GaitTable, take: Take, cycles: int) -> float:
    """Simulated by planned, over the cycles after the first."""
    assert take.p_WB is not None
    ends = np.array([table.start_seconds + table.period * c for c in (1, cycles)])
    seconds = float(ends[1] - ends[0])
    asked = float(np.hypot(*planned.task.velocity))
    if not asked:
        assert take.quat_WB is not None
        w, x, y, z = take.quat_WB.T
        heading = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
        turned = np.interp(ends, take.time, heading)
        return abs(float(turned[1] - turned[0]) / seconds / planned.task.turn_rate)
    x, y = (np.interp(ends, take.time, take.p_WB[:, i]) for i in (0, 1))
    return float(np.hypot(x[1] - x[0], y[1] - y[0])) / seconds / asked
