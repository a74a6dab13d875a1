"""The compiled station's data: a robot, its schedule and its state as plain arrays, grouped by subject.

n joints turn (servos' and those put between servo and link), m of them are servos', in the model's order. The root R is the base,
or the world where the base is held. nv = n + 6 velocities: of a free base its w_WB and v_WB, both in W, then the joints', as in
Drake. Bodies are numbered by their joint, the root is number n. Everything is SI; all arrays are C-contiguous.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.types import Array

Ints = NDArray[np.int64]
Numbers = NDArray[np.uint32]
"""Of velocities, bodies and columns. They have no sign, so that numba leaves out a test of each index for counting from the end;
in short loops that took as long as the arithmetic."""


BOX, CYLINDER, OTHER = 0, 1, 2
LINK_CONTACTS = 32
"""Contacts between links that there is room for; Drake has the rest."""


class Tree(NamedTuple):
    """Kinematics, inertia and joint forces. parent (n,): body that carries each joint, -1 for the root; carrier (n,): the same, n
    for the root. path (nv,): the velocity before each on the way to the root, -1 at its end; depth (nv,): how many are on that
    way; above (nv, d): they and the velocity itself, the root's first, zeros behind. number (nv,), every (nv, nv): the same as
    depth and above if all velocities before one were on its way. order: velocities beyond a free base's by depth. forks (nv,):
    whether limbs part at a velocity or beyond it; a base's count as such. limbs: those that are none, by depth. inner (nv,): how
    many forks are on the way. joined: forks beyond the base and velocities beyond such. group (nv,): the tree of Drake's forest
    that a velocity belongs to. R (n, 3, 3), p (n, 3): the joint's frame in its carrier's. axis (n, 3). mass (n+1,), com (n+1, 3)
    and inertia (n+1, 6): of bodies in their joint's frame, inertia xx yy zz xy xz yz about the centre of mass. armature, damping,
    stiffness, rest, lower, upper (n,): of joints. brake (n,): most torque of its dry friction, brake_gain (n,) its damping while
    it holds. gravity, pull (3,): the latter on the base's origin."""

    free: bool
    parent: Ints
    carrier: Numbers
    path: Ints
    depth: Numbers
    above: Numbers
    number: Numbers
    every: Numbers
    order: Numbers
    forks: NDArray[np.bool_]
    limbs: Numbers
    inner: Numbers
    joined: Numbers
    group: Numbers
    R: Array
    p: Array
    axis: Array
    mass: Array
    com: Array
    inertia: Array
    armature: Array
    damping: Array
    stiffness: Array
    rest: Array
    lower: Array
    upper: Array
    brake: Array
    brake_gain: Array
    gravity: Array
    pull: Array


class Servos(NamedTuple):
    """The law's constants (m,) and servo behaviour beyond it. joint (m,): number of each. zero (m,) [rad]: of the link.

    terms: whether there is anything beyond. varies: whether friction does. most (m,): the most friction. ceiling (m,).
    sag (a,): volts lost for each servo at full duty, by term; supply (m,) [V]. fade [1/s]. sticking (b, m), speed (b,):
    friction at rest and the speed at which it fades. rubbing (m,): friction by load; still (c, m), still_speed (c,): more of it
    at rest; backwards (m,): more where the load drives the motor. bend (m,): one over the torque at which a motor saturates.
    lopsided (d, m): shares by which friction is more forwards, by term. derivative [duty per rad/s], ramp [rad/s], lag [s] (m,):
    of the law. table_servo, table_of (t,): the servo of each torque table, and its argument (`workbench.servo.tabled`);
    table_at, table_torque (t, K): its knots and torques."""

    joint: Numbers
    zero: Array
    gain: Array
    margin: Array
    punch: Array
    full_torque: Array
    back_emf: Array
    viscous: Array
    coulomb: Array
    derivative: Array
    ramp: Array
    lag: Array
    terms: bool
    varies: bool
    most: Array
    ceiling: Array
    sag: Array
    supply: Array
    fade: float
    sticking: Array
    speed: Array
    rubbing: Array
    still: Array
    still_speed: Array
    backwards: Array
    bend: Array
    lopsided: Array
    table_servo: Ints
    table_of: Ints
    table_at: Array
    table_torque: Array


class Shapes(NamedTuple):
    """Collision shapes. body (s,); p (s, 3) their middle, R (s, 3, 3) and half (s, 3): their box, in the body's frame; radius
    (s,): of spheres, 0 of others; solid (s,): BOX, CYLINDER along its box's z, or OTHER; size (s,): from the middle to the
    farthest point of shape or box. stiffness, dissipation, friction, depth
    (s,): of the pair with the ground; where between ground (0) and shape (1) the contact point is. bodies (b,), middle (b, 3),
    reach (b,): a ball round the shapes of each body that has any. near (k, 2): numbers in `bodies` of those that can touch each
    other. may_touch (s, s). pair (s, s): row in `pairs` of a sphere (first) and its partner in a contact that is known, -1
    of others; pairs (k, 4): stiffness, dissipation, friction, and where between the other (0) and the sphere (1) the point is."""

    body: Numbers
    p: Array
    R: Array
    half: Array
    radius: Array
    solid: Ints
    size: Array
    stiffness: Array
    dissipation: Array
    friction: Array
    depth: Array
    bodies: Numbers
    middle: Array
    reach: Array
    near: Numbers
    may_touch: NDArray[np.bool_]
    pair: Ints
    pairs: Array


class Schedule(NamedTuple):
    """What happens when. steps of length dt; log_every: steps between two rows of the log. begin [s]: the first command,
    on which terms count. command_step (K,): the step before which a command comes, late (K,) [s] how long before; goal (K, m),
    speed (K, m), on (K, m). put_step (P,): the step before which the robot is put somewhere: a free base to quat (P, 4), v, w
    (P, 3) as in BaseStates; the servos of a held one to q, qdot (P, m) as in JointStates."""

    dt: float
    steps: int
    log_every: int
    begin: float
    command_step: Ints
    late: Array
    goal: Array
    speed: Array
    on: NDArray[np.bool_]
    put_step: Ints
    put_quat: Array
    put_v: Array
    put_w: Array
    put_q: Array
    put_qdot: Array


class State(NamedTuple):
    """Changed by a run. base (7,): quaternion wxyz and position of the base in W; q (n,), v (nv,); reference (m,): the ramp;
    goal, reach (m,): of the command, and how far the ramp goes in a step; lagging (m,): the goal behind its filter; on (m,).
    memory (4, m): velocity, the known load, load and friction of the step before; stepped (1,): 1 where there was
    one."""

    base: Array
    q: Array
    v: Array
    reference: Array
    goal: Array
    lagging: Array
    reach: Array
    on: NDArray[np.bool_]
    memory: Array
    stepped: Array


class Log(NamedTuple):
    """Written by a run. q, v (rows, n); base (rows, 7) with the turns of `put` taken out; torque (rows, m) on the servos' joints;
    force (rows, s, 3): of the ground on each shape, in W. torque and force may have no rows: not wanted."""

    q: Array
    v: Array
    base: Array
    torque: Array
    force: Array


class Work(NamedTuple):
    """Room for one step, made once a run. Spatial vectors are about the root's origin, in W: rotational, then translational.

    M and H have row k's entries in the columns of `Tree.above[k]`; the Jacobian J (c, 3, ..) of contact c has its own in the
    columns of `Tree.above[last[c]]`, the last velocity that moves it, or of `Tree.every` where its links are on two branches:
    then other[c] is the other's last, else -1. Columns behind them hold anything. pivot (nv,): the diagonal of H's factor.
    crossed (1,): whether any contact has links on two branches; whole (nv, nv): H then. shape[c]: of a contact on the floor,
    or -1 between links. frame (3, 3): axes of the contact that is being found, in rows."""

    R: Array
    p: Array
    S: Array
    mass: Array
    moment: Array
    inertia: Array
    V: Array
    A: Array
    F: Array
    M: Array
    H: Array
    pivot: Array
    whole: Array
    force: Array
    v_star: Array
    v_next: Array
    momentum: Array
    momentum_star: Array
    gradient: Array
    impulse: Array
    scale: Array
    dv: Array
    dp: Array
    active: NDArray[np.bool_]
    brake_gain: Array
    limit_on: NDArray[np.bool_]
    limit_v: Array
    limit_R: Array
    push: Array
    motor: Array
    relief: Array
    shape: Ints
    last: Ints
    other: Ints
    crossed: NDArray[np.bool_]
    stiffness: Array
    dissipation: Array
    friction: Array
    J: Array
    elastic: Array
    normal: Array
    soft: Array
    vc: Array
    dvc: Array
    hessian: Array
    turned: Array
    frame: Array


ROW = 8
"""Rows of matrices are a multiple of this long, and begin where processors load so many numbers at once."""


def _rows(count: int, width: int) -> Array:
    """Zeros (count, width), rows longer up to a multiple of ROW."""
    width = -(-width // ROW) * ROW
    raw = np.zeros(count * width + ROW)
    begin = (-raw.ctypes.data // raw.itemsize) % ROW
    return raw[begin:begin + count * width].reshape(count, width)


def work_for(tree: Tree, servos: Servos, shapes: Shapes) -> Work:
    """Room for one run of a robot."""
    n, nv, m, c = len(tree.parent), len(tree.path), len(servos.joint), len(shapes.body) + LINK_CONTACTS
    zeros, depth = np.zeros, tree.above.shape[1]
    return Work(
        R=zeros((n + 1, 3, 3)), p=zeros((n + 1, 3)), S=zeros((nv, 6)), mass=zeros(n + 1), moment=zeros((n + 1, 3)),
        inertia=zeros((n + 1, 6)), V=zeros((n + 1, 6)), A=zeros((n + 1, 6)), F=zeros((n + 1, 6)), M=_rows(nv, depth),
        H=_rows(nv, depth), pivot=zeros(nv), whole=zeros((nv, nv)), force=zeros(nv), v_star=zeros(nv), v_next=zeros(nv),
        momentum=zeros(nv), momentum_star=zeros(nv), gradient=zeros(nv), impulse=zeros(nv), scale=zeros(nv), dv=zeros(nv),
        dp=zeros(nv), active=zeros(int(tree.group.max(initial=0)) + 1, dtype=np.bool_), brake_gain=zeros(n),
        limit_on=zeros((n, 2), dtype=np.bool_), limit_v=zeros((n, 2)), limit_R=zeros(n), push=zeros(m), motor=zeros(m),
        relief=zeros(m), shape=zeros(c, dtype=np.int64), last=zeros(c, dtype=np.int64), other=zeros(c, dtype=np.int64),
        crossed=zeros(1, dtype=np.bool_), stiffness=zeros(c), dissipation=zeros(c), friction=zeros(c),
        J=_rows(3 * c, nv).reshape(c, 3, -1), elastic=zeros(c), normal=zeros(c), soft=zeros(c), vc=zeros((c, 3)),
        dvc=zeros((c, 3)), hessian=zeros((c, 4)), turned=zeros(4), frame=zeros((3, 3)))
