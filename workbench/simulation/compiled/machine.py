"""One model in one configuration, as the arrays that kernels take."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from workbench.effects.apply import Physics
from workbench.effects.sdf import SPRING_TIME
from workbench.robot import RobotModel
from workbench.servo.bank import HOLDING_DAMPING, MOST_CREEP
from workbench.servo.terms import TermNumbers, most_friction
from workbench.simulation.compiled.arrays import Array, Ints, Servos, Shapes, Tree
from workbench.simulation.compiled.tables import NotCoveredError, ShapeTable, Tables
from workbench.simulation.contact import RIGID_STIFFNESS, partner_friction

UNTOUCHED = 1.0
"""Stiffness [N/m] of shapes that touch nothing, as numbers have to be there."""


class Machine(NamedTuple):
    """See `arrays`."""

    tree: Tree
    servos: Servos
    shapes: Shapes


def machine_of(model: RobotModel, physics: Physics, tables: Tables, free: bool, dt: float) -> Machine:
    """NotCoveredError says what the arrays cannot hold."""
    missing = [j for j in model.joints if j not in tables.joints]
    if missing:
        raise NotCoveredError(f"joint '{missing[0]}' does not turn")
    joint = np.array([tables.joints.index(j) for j in model.joints], dtype=np.int64)
    return Machine(_tree(physics, tables, joint, dt), _servos(physics, joint), _shapes(model, physics, tables, free))


def _tree(physics: Physics, tables: Tables, joint: Ints, dt: float) -> Tree:
    armature, damping = tables.tree.armature.copy(), tables.tree.damping.copy()
    stages = [tables.joints.index(s) for names in physics.stages.values() for s in names]
    damping[stages] *= max(1.0, dt / (2 * SPRING_TIME))  # as the station steadies springs
    armature[joint], damping[joint] = physics.law.inertia, physics.law.damping
    most = most_friction(physics.terms, physics.law)
    brake, gain = np.zeros(len(tables.joints)), np.zeros(len(tables.joints))
    brake[joint] = most
    gain[joint] = np.where(most == physics.law.coulomb, HOLDING_DAMPING, np.maximum(HOLDING_DAMPING, most / MOST_CREEP))
    return tables.tree._replace(armature=armature, damping=damping, brake=brake, brake_gain=gain,
                                gravity=np.array(physics.gravity, dtype=float), pull=np.array(physics.tether, dtype=float))


def _servos(physics: Physics, joint: Ints) -> Servos:
    law, n = physics.law, len(joint)
    numbers: list[TermNumbers] = []
    for term in physics.terms:
        said = term.numbers()
        if said is None:
            raise NotCoveredError(f"what servos do by {type(term).__module__.rsplit('.', 1)[-1]}")
        numbers.append(said)
    ceiling, rubbing, backwards, bend = np.full(n, np.inf), np.zeros(n), np.zeros(n), np.zeros(n)
    for t in numbers:
        ceiling = ceiling if t.ceiling is None else np.minimum(ceiling, t.ceiling)
        rubbing = rubbing if t.rubbing is None else rubbing + t.rubbing
        backwards = backwards if t.rubbing_backwards is None else backwards + t.rubbing_backwards
        bend = bend if t.bend is None else bend + t.bend
    still = [t for t in numbers if t.rubbing_still is not None]
    lopsided = [t.lopsided for t in numbers if t.lopsided is not None]
    sticking = [t for t in numbers if t.sticking is not None]
    most = most_friction(physics.terms, law)
    return Servos(
        joint=joint, zero=_array(physics.zero), gain=_array(law.gain), margin=_array(law.margin), punch=_array(law.punch),
        full_torque=_array(law.full_torque), back_emf=_array(law.back_emf), viscous=_array(law.viscous),
        coulomb=_array(law.coulomb), terms=bool(numbers), varies=bool((most > law.coulomb).any()), most=_array(most),
        ceiling=ceiling, sag=np.array([t.sag for t in numbers if t.sag]), supply=_array(law.full_torque / law.torque_per_volt),
        fade=float(sum(t.fade for t in numbers)), sticking=_array([t.sticking for t in sticking]).reshape(len(sticking), n),
        speed=np.array([t.speed for t in sticking]), rubbing=rubbing,
        still=_array([t.rubbing_still for t in still]).reshape(len(still), n),
        still_speed=_array([t.rubbing_speed for t in still]),
        backwards=backwards, bend=bend, lopsided=_array(lopsided).reshape(len(lopsided), n))


def _shapes(model: RobotModel, physics: Physics, tables: Tables, free: bool) -> Shapes:
    t = tables.shapes
    stiffness, dissipation, friction, depth = _pairs(model, physics, t) if free else (np.zeros(len(t.body)),) * 4
    bodies = np.unique(t.body)
    middle, reach = np.zeros((len(bodies), 3)), np.zeros(len(bodies))
    for i, b in enumerate(bodies):
        here = t.body == b
        middle[i] = t.p[here].mean(axis=0)
        size = np.where(t.radius[here] > 0, t.radius[here], np.linalg.norm(t.half[here], axis=1))
        reach[i] = float(np.max(np.linalg.norm(t.p[here] - middle[i], axis=1) + size))
    near = [(i, k) for i, a in enumerate(bodies) for k, b in enumerate(bodies[:i])
            if t.may_touch[np.ix_(t.body == a, t.body == b)].any()]
    return Shapes(
        body=t.body, p=t.p, R=t.R, half=t.half, radius=t.radius, stiffness=stiffness, dissipation=dissipation, friction=friction,
        depth=depth, bodies=bodies, middle=middle, reach=reach, near=np.array(near, dtype=np.int64).reshape(-1, 2),
        may_touch=t.may_touch)


def _pairs(model: RobotModel, physics: Physics, t: ShapeTable) -> tuple[Array, Array, Array, Array]:
    """Stiffness, dissipation and friction of each shape's pair with the ground, and where between them the point of contact is,
    as AddGround and SetFootContact set the materials and Drake combines them (`workbench.simulation.contact`)."""
    ground, n = physics.ground, len(t.body)
    own_ground = ground.stiffness if ground.stiffness is not None and math.isfinite(ground.stiffness) else RIGID_STIFFNESS
    given = [f for f in t.friction if f is not None]
    mu_ground = ground.friction if ground.friction is not None else float(np.mean(given)) if given else 1.0
    feet = {model.kinematics.frames[foot].child: value for foot, value in physics.foot_friction.items()}
    stiffness, dissipation, friction, depth = np.zeros((4, n))
    for s in range(n):
        k = t.stiffness[s] if physics.foot_stiffness is None else physics.foot_stiffness
        d = t.dissipation[s]
        mu = t.friction[s] if ground.friction is None else ground.friction
        if t.link[s] in feet:
            mu = partner_friction(feet[t.link[s]], mu_ground)
        if k is None or d is None or mu is None:
            if t.radius[s] > 0.0:
                raise NotCoveredError(f"a foot of '{t.link[s]}' without stiffness, dissipation or friction of its own")
            k, d, mu = UNTOUCHED, 0.0, 0.0
        both = k + own_ground
        stiffness[s], depth[s] = k * own_ground / both, k / both
        dissipation[s] = own_ground / both * d + k / both * (ground.dissipation or 0.0)
        friction[s] = 2.0 * mu * mu_ground / (mu + mu_ground) if mu + mu_ground > 0.0 else 0.0
    return stiffness, dissipation, friction, depth


def _array(values: object) -> Array:
    return np.ascontiguousarray(np.array(values, dtype=float))
