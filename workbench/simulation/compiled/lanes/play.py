"""A run of several robots in step: the function that Python calls."""

from __future__ import annotations

import math
from typing import Any

from workbench.simulation.compiled.arrays import Ints, Schedule, Shapes, State, Tree
from workbench.simulation.compiled.kernel import kernel, part
from workbench.simulation.compiled.lanes.arrays import LaneServos, Lost, Room
from workbench.simulation.compiled.lanes.links import touching
from workbench.simulation.compiled.lanes.servo import advance_servos, command, push_joints, put_servos
from workbench.simulation.compiled.lanes.solve import prepare, solve
from workbench.simulation.compiled.number import LANES, as_wide, lane, where, wide
from workbench.simulation.compiled.tree import gather, move_bodies, place_bodies, weigh_bodies
from workbench.types import Array


@part
def _wide_tree(t: Tree) -> Tree:
    return Tree(
        False, t.parent, t.carrier, t.path, t.depth, t.above, t.number, t.every, t.order, t.forks, t.limbs, t.inner, t.joined,
        t.group, as_wide(t.R), as_wide(t.p), as_wide(t.axis), as_wide(t.mass), as_wide(t.com), as_wide(t.inertia),
        as_wide(t.armature), as_wide(t.damping), as_wide(t.stiffness), as_wide(t.rest), as_wide(t.lower), as_wide(t.upper),
        as_wide(t.brake), as_wide(t.brake_gain), as_wide(t.gravity), t.pull)


@part
def _wide_servos(s: LaneServos) -> LaneServos:
    return LaneServos(
        s.joint, s.terms, s.varies, s.lags, as_wide(s.zero), as_wide(s.gain), as_wide(s.margin), as_wide(s.punch),
        as_wide(s.full_torque), as_wide(s.back_emf), as_wide(s.coulomb), as_wide(s.derivative), as_wide(s.ramp), as_wide(s.lag),
        as_wide(s.most), as_wide(s.ceiling), as_wide(s.supply), as_wide(s.rubbing), as_wide(s.backwards), as_wide(s.bend),
        as_wide(s.fade), as_wide(s.sag), as_wide(s.sticking), as_wide(s.speed), as_wide(s.still), as_wide(s.still_speed),
        as_wide(s.lopsided))


@part
def _wide_state(s: State) -> State:
    return State(s.base, as_wide(s.q), as_wide(s.v), as_wide(s.reference), as_wide(s.goal), as_wide(s.lagging), as_wide(s.reach),
                 s.on, as_wide(s.memory), s.stepped)


@part
def _wide_room(w: Room) -> Any:  # of the attributes of `Work` that steps of a held robot take
    return Room(
        as_wide(w.R), as_wide(w.p), as_wide(w.S), as_wide(w.mass), as_wide(w.moment), as_wide(w.inertia), as_wide(w.V),
        as_wide(w.A), as_wide(w.F), as_wide(w.M), as_wide(w.H), as_wide(w.force), as_wide(w.v_star), as_wide(w.v_next),
        as_wide(w.momentum), as_wide(w.momentum_star), as_wide(w.gradient), as_wide(w.scale), as_wide(w.dv), as_wide(w.dp),
        as_wide(w.brake_gain), as_wide(w.limit_R), as_wide(w.limit_v), as_wide(w.active), as_wide(w.push), as_wide(w.motor),
        as_wide(w.relief), w.lane_R)


@kernel
def play_lanes(trees: Tree, bank: LaneServos, shapes: Shapes, schedule: Schedule, at: Ints, end: Ints, states: State, q: Array,
               lost: Lost, rooms: Room) -> None:
    """Plays a schedule from states on, as `run`, into q (LANES, rows, n) [rad]. at, end (LANES,): the first command of each lane,
    and behind its last; at moves on. lost (LANES,): lanes whose numbers are not to be used, as links touched or a step was not
    solved."""
    tree, servos, state, w = _wide_tree(trees), _wide_servos(bank), _wide_state(states), _wide_room(rooms)
    n, dt = tree.parent.shape[0], schedule.dt
    gone = wide(0.0) > wide(0.0)
    puts = 0
    for k in range(schedule.steps + 1):
        if k % schedule.log_every == 0 and k // schedule.log_every < q.shape[1]:
            for i in range(n):
                for l in range(LANES):
                    q[l, k // schedule.log_every, i] = lane(state.q[i], l)
        while puts < schedule.put_step.shape[0] and schedule.put_step[puts] == k:
            put_servos(servos, schedule, puts, state)
            puts += 1
        command(schedule, k, at, end, bank, states)
        if k == schedule.steps:
            break
        place_bodies(tree, state, w)
        move_bodies(tree, state, w)
        weigh_bodies(tree, w)
        for i in range(n):
            w.force[i] = 0.0
        push_joints(servos, max(k * dt - schedule.begin, 0.0), state, w)
        gather(tree, state, dt, w)
        gone = touching(shapes, gone, w)
        gone = solve(tree, dt, prepare(tree, dt, state, w), gone, w)
        advance_servos(tree, servos, dt, state, w)
        for i in range(n):
            state.v[i] = w.v_next[i]
            state.q[i] += dt * state.v[i]
    ended = where(gone, 1.0, 0.0)
    for l in range(LANES):
        lost[l] = lane(ended, l) > 0.0 or not math.isfinite(lane(state.q[0], l))
