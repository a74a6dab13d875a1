"""One model in one configuration, as the arrays that kernels take."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.effects.apply import Physics
from workbench.effects.sdf import SPRING_TIME
from workbench.robot import RobotModel
from workbench.servo.bank import HOLDING_DAMPING, MOST_CREEP
from workbench.servo.tabled import arrays_of
from workbench.servo.terms import TermNumbers, most_friction
from workbench.simulation.compiled.arrays import OTHER, Array, Ints, Numbers, Servos, Shapes, Tree
from workbench.simulation.compiled.tables import NotCoveredError, ShapeTable, Tables
from workbench.simulation.contact import RIGID_STIFFNESS, partner_friction

UNTOUCHED = 1.0
"""Stiffness [N/m] of shapes that touch nothing, as numbers have to be there."""


class Machine(NamedTuple):
    """See `arrays`."""

    tree: Tree
    servos: Servos
    shapes: Shapes


def machine_of(model: RobotModel, physics: Physics, tables: Tables, free: bool, dt: float, apart: bool = False) -> Machine:
    """NotCoveredError names the part that the arrays cannot hold. apart: contacts between links are not known, and end a run."""
    missing = [j for j in model.joints if j not in tables.joints]
    if missing:
        raise NotCoveredError(f"joint '{missing[0]}' does not turn")
    joint = np.array([tables.joints.index(j) for j in model.joints], dtype=np.uint32)
    kept = f"shapes, {'apart' if apart else 'touching'}"
    shapes = None if free else tables.derived.get(kept)  # of a held robot nothing but the tables decides them
    if not isinstance(shapes, Shapes):
        shapes = tables.derived[kept] = _shapes(model, physics, tables, free, apart)
    return Machine(_tree(physics, tables, joint, dt), _servos(physics, joint), shapes)


def _tree(physics: Physics, tables: Tables, joint: Numbers, dt: float) -> Tree:
    armature, damping = tables.tree.armature.copy(), tables.tree.damping.copy()
    stages = [tables.joints.index(s) for names in physics.stages.values() for s in names]
    damping[stages] *= max(1.0, dt / (2 * SPRING_TIME))  # as the station steadies springs
    armature[joint], damping[joint] = physics.law.inertia, physics.law.damping
    most = most_friction(physics.servo_terms, physics.law)
    brake, gain = np.zeros(len(tables.joints)), np.zeros(len(tables.joints))
    brake[joint] = most
    gain[joint] = np.where(most == physics.law.coulomb, HOLDING_DAMPING, np.maximum(HOLDING_DAMPING, most / MOST_CREEP))
    return tables.tree._replace(armature=armature, damping=damping, brake=brake, brake_gain=gain,
                                gravity=np.array(physics.gravity, dtype=float), pull=np.array(physics.tether, dtype=float))


def _servos(physics: Physics, joint: Numbers) -> Servos:
    law, n = physics.law, len(joint)
    numbers: list[TermNumbers] = []
    for term in physics.servo_terms:
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
    most = most_friction(physics.servo_terms, law)
    table_servo, table_of, table_at, table_torque = arrays_of([t for said in numbers for t in said.tables])
    return Servos(
        joint=joint, zero=_array(physics.zero), gain=_array(law.gain), margin=_array(law.margin), punch=_array(law.punch),
        full_torque=_array(law.full_torque), back_emf=_array(law.back_emf), viscous=_array(law.viscous),
        coulomb=_array(law.coulomb), derivative=_array(law.derivative), ramp=_array(law.ramp), lag=_array(law.lag),
        terms=bool(numbers), varies=bool((most > law.coulomb).any()), most=_array(most),
        ceiling=ceiling, sag=np.array([t.sag for t in numbers if t.sag]), supply=_array(law.full_torque / law.torque_per_volt),
        fade=float(sum(t.fade for t in numbers)), sticking=_array([t.sticking for t in sticking]).reshape(len(sticking), n),
        speed=np.array([t.speed for t in sticking]), rubbing=rubbing,
        still=_array([t.rubbing_still for t in still]).reshape(len(still), n),
        still_speed=_array([t.rubbing_speed for t in still]),
        backwards=backwards, bend=bend, lopsided=_array(lopsided).reshape(len(lopsided), n),
        table_servo=table_servo, table_of=table_of, table_at=table_at, table_torque=table_torque)


def _shapes(model: RobotModel, physics: Physics, tables: Tables, free: bool, apart: bool) -> Shapes:
    t = tables.shapes
    own = _materials(model, physics, t, free)
    stiffness, dissipation, friction, depth = _on_floor(physics, t, own) if free else np.zeros((4, len(t.body)))
    size = np.where(t.radius > 0, t.radius, np.linalg.norm(t.half, axis=1))
    bodies = np.unique(t.body)
    middle, reach = np.zeros((len(bodies), 3)), np.zeros(len(bodies))
    for i, b in enumerate(bodies):
        here = t.body == b
        middle[i] = t.p[here].mean(axis=0)
        reach[i] = float(np.max(np.linalg.norm(t.p[here] - middle[i], axis=1) + size[here]))
    near = [(i, k) for i, a in enumerate(bodies) for k, b in enumerate(bodies[:i])
            if t.may_touch[np.ix_(t.body == a, t.body == b)].any()]
    pair, pairs = _between(t, own, apart)
    return Shapes(
        body=t.body.astype(np.uint32), p=t.p, R=t.R, half=t.half, radius=t.radius, solid=t.solid, size=size, stiffness=stiffness,
        dissipation=dissipation, friction=friction, depth=depth, bodies=bodies.astype(np.uint32), middle=middle, reach=reach,
        near=np.array(near, dtype=np.uint32).reshape(-1, 2), may_touch=t.may_touch, pair=pair, pairs=pairs)


def _materials(model: RobotModel, physics: Physics, t: ShapeTable, free: bool) -> Array:
    """Stiffness, dissipation and friction (s, 3) of each shape, as AddGround and SetFootContact set them (`workbench.simulation.
    contact`), on a free base alone; NaN where nothing says them."""
    out = np.array([t.stiffness, t.dissipation, t.friction], dtype=float).T.reshape(-1, 3)
    if not free:
        return out
    if physics.foot_stiffness is not None:
        out[:, 0] = physics.foot_stiffness
    if physics.ground.friction is not None:
        out[:, 2] = physics.ground.friction
    feet = {model.kinematics.frames[foot].child: value for foot, value in physics.foot_friction.items()}
    ground = _ground_friction(physics, t)
    for s, link in enumerate(t.link):
        if link in feet:
            out[s, 2] = partner_friction(feet[link], ground)
    return out


def _ground_friction(physics: Physics, t: ShapeTable) -> float:
    given = [f for f in t.friction if f is not None]
    if physics.ground.friction is not None:
        return physics.ground.friction
    return float(np.mean(given)) if given else 1.0


def _on_floor(physics: Physics, t: ShapeTable, own: Array) -> Array:
    """Stiffness, dissipation and friction of each shape's pair with the ground, and where between them the point of contact is:
    (4, s)."""
    missing = _not_said(own)
    if (missing & (t.radius > 0.0)).any():
        foot = t.link[int(np.argmax(missing & (t.radius > 0.0)))]
        raise NotCoveredError(f"a foot of '{foot}' without stiffness, dissipation or friction of its own")
    ground = physics.ground
    stiffness = ground.stiffness if ground.stiffness is not None and math.isfinite(ground.stiffness) else RIGID_STIFFNESS
    floor = np.array([stiffness, ground.dissipation or 0.0, _ground_friction(physics, t)])
    return _combined(np.where(missing[:, None], [UNTOUCHED, 0.0, 0.0], own), floor)


def _between(t: ShapeTable, own: Array, apart: bool) -> tuple[Ints, Array]:
    """`Shapes.pair` and `Shapes.pairs`: spheres with spheres, boxes and cylinders of other links, whose materials are said."""
    known = ~_not_said(own)
    solid = (t.radius > 0.0) | (t.solid != OTHER)
    holds = t.may_touch & ((t.radius > 0.0) & known)[:, None] & (solid & known) & (not apart)
    pair = np.full(holds.shape, -1, dtype=np.int64)
    ball, other = np.nonzero(holds)
    pair[ball, other] = np.arange(len(ball))
    return pair, np.ascontiguousarray(_combined(own[ball], own[other]).T)


def _not_said(own: Array) -> NDArray[np.bool_]:
    return np.asarray(np.isnan(own).any(axis=1))


def _combined(a: Array, b: Array) -> Array:
    """Stiffness, dissipation and friction of pairs, and where the point of contact is between b (0) and a (1), as Drake combines
    the materials (k, 3) of both: (4, k)."""
    (ka, da, ma), (kb, db, mb) = a.T, b.T
    both, rough = ka + kb, ma + mb
    friction = np.divide(2.0 * ma * mb, rough, out=np.zeros(np.broadcast(ma, mb).shape), where=rough > 0.0)
    return np.array([ka * kb / both, kb / both * da + ka / both * db, friction, ka / both])


def _array(values: object) -> Array:
    return np.ascontiguousarray(np.array(values, dtype=float))
