"""A run of steps, and its preparation: the functions that Python calls."""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import Log, Schedule, Servos, Shapes, State, Tree, Work
from workbench.simulation.compiled.contact import floor_contacts
from workbench.simulation.compiled.kernel import kernel, part
from workbench.simulation.compiled.links import UNKNOWN, link_contacts
from workbench.simulation.compiled.put import drop, put, put_servos
from workbench.simulation.compiled.servo import advance_servos, braking, command, push_joints
from workbench.simulation.compiled.solve import prepare, solve
from workbench.simulation.compiled.tree import gather, move_bodies, place_bodies, weigh_bodies
from workbench.simulation.compiled.vectors import quat_about_z, quat_of, quat_product, quat_unit

DONE, TOUCHED, FAILED = 0, 1, 2
"""How a run ended: as it should; before something touched that this station does not know; the solver did not converge, or
numbers ran away."""


@part
def _solve_step(tree: Tree, servos: Servos, shapes: Shapes, dt: float, elapsed: float, state: State, w: Work) -> int:
    """Velocities at the step's end, in w.v_next, from the state at its begin; how it ended, and the contacts in w.shape[:count]
    as count above."""
    place_bodies(tree, state, w)
    move_bodies(tree, state, w)
    weigh_bodies(tree, w)
    for k in range(w.force.shape[0]):
        w.force[k] = 0.0
    push_joints(servos, elapsed, 6 if tree.free else 0, state, w)
    gather(tree, state, dt, w)
    count = floor_contacts(tree, shapes, state, dt, w) if tree.free else 0
    count = link_contacts(tree, shapes, state, dt, count, w)
    if count == UNKNOWN:
        return -TOUCHED
    prepare(tree, state, dt, count, w)
    return count if solve(tree, dt, count, w) >= 0 else -FAILED


@part
def _integrate(tree: Tree, dt: float, state: State, w: Work) -> None:
    """Positions by the velocities at the step's end; the quaternion by its rate, which leaves its length as it gets."""
    n = tree.parent.shape[0]
    o = 6 if tree.free else 0
    for k in range(n + o):
        state.v[k] = w.v_next[k]
    for i in range(n):
        state.q[i] += dt * state.v[o + i]
    if tree.free:
        a = quat_of(state.base)
        dw, dx, dy, dz = quat_product((0.0, 0.5 * dt * state.v[0], 0.5 * dt * state.v[1], 0.5 * dt * state.v[2]), a)
        state.base[0], state.base[1], state.base[2], state.base[3] = a[0] + dw, a[1] + dx, a[2] + dy, a[3] + dz
        for k in range(3):
            state.base[4 + k] += dt * state.v[3 + k]


@part
def _write_state(tree: Tree, state: State, row: int, log: Log, w: Work) -> None:
    o = 6 if tree.free else 0
    for i in range(tree.parent.shape[0]):
        log.q[row, i] = state.q[i]
        log.v[row, i] = state.v[o + i]
    a = quat_product(quat_about_z(w.turned[0]), quat_unit(quat_of(state.base)))
    log.base[row, 0], log.base[row, 1], log.base[row, 2], log.base[row, 3] = a
    c, s = math.cos(w.turned[0]), math.sin(w.turned[0])
    log.base[row, 4] = w.turned[1] + c * state.base[4] - s * state.base[5]
    log.base[row, 5] = w.turned[2] + s * state.base[4] + c * state.base[5]
    log.base[row, 6] = state.base[6]


@part
def _write_forces(tree: Tree, servos: Servos, shapes: Shapes, dt: float, count: int, state: State, row: int, log: Log, w: Work
                  ) -> None:
    """Torques and ground forces over the step that has been solved."""
    o = 6 if tree.free else 0
    if row < log.torque.shape[0]:
        for i in range(servos.joint.shape[0]):
            j = servos.joint[i]
            viscous = servos.viscous[i] * state.v[o + j]
            friction = braking(tree, w, j, w.v_next[o + j]) if tree.brake[j] > 0.0 else 0.0
            log.torque[row, i] = w.motor[i] - viscous + friction + w.relief[i]
    if row < log.force.shape[0]:
        for s in range(shapes.body.shape[0]):
            for r in range(3):
                log.force[row, s, r] = 0.0
        for c in range(count):
            s = w.shape[c]
            if s < 0:  # not the floor's
                continue
            x, y, z = w.vc[c, 0], w.vc[c, 1], w.vc[c, 2]
            slip = w.friction[c] * w.normal[c] / math.sqrt(x * x + y * y + w.soft[c] * w.soft[c])
            elastic, damping = w.elastic[c] - dt * w.stiffness[c] * z, 1.0 - w.dissipation[c] * z
            log.force[row, s, 0], log.force[row, s, 1] = -slip * x / dt, -slip * y / dt
            log.force[row, s, 2] = max(elastic, 0.0) * max(damping, 0.0)


@kernel
def stand(tree: Tree, servos: Servos, shapes: Shapes, state: State, w: Work) -> None:
    """Puts the joints to neutral and a free base level, with the robot's lowest box on the floor."""
    for i in range(servos.joint.shape[0]):
        state.q[servos.joint[i]] = servos.zero[i]
    if tree.free:
        drop(tree, shapes, state, w)


@kernel
def run(tree: Tree, servos: Servos, shapes: Shapes, schedule: Schedule, state: State, log: Log, w: Work) -> int:
    """Plays a schedule from a state on, holding the state's goals until the first command, into the log; returns how it ended.

    A schedule without commands, begun at infinity and logged nowhere, lets the robot come to rest."""
    rest = quat_unit(quat_of(state.base))
    commands = puts = 0
    for k in range(4):
        w.turned[k] = 0.0
    rows = log.q.shape[0]
    wanted = max(log.torque.shape[0], log.force.shape[0])
    for k in range(schedule.steps + 1):
        row = k // schedule.log_every if k % schedule.log_every == 0 else rows
        elapsed = max(k * schedule.dt - schedule.begin, 0.0)
        if row < rows:
            _write_state(tree, state, row, log, w)
        is_put = puts < schedule.put_step.shape[0] and schedule.put_step[puts] == k
        if is_put and row < wanted:  # the log is of the robot as it came here
            count = _solve_step(tree, servos, shapes, schedule.dt, elapsed, state, w)
            if count < 0:
                return -count
            _write_forces(tree, servos, shapes, schedule.dt, count, state, row, log, w)
        while puts < schedule.put_step.shape[0] and schedule.put_step[puts] == k:
            if tree.free:
                put(tree, shapes, schedule, puts, rest, state, w)
            else:
                put_servos(servos, schedule, puts, state)
            puts += 1
        while commands < schedule.command_step.shape[0] and schedule.command_step[commands] == k:
            command(schedule, commands, servos, state)
            commands += 1
        if k == schedule.steps and row >= wanted:
            break
        count = _solve_step(tree, servos, shapes, schedule.dt, elapsed, state, w)
        if count < 0:
            return -count
        if row < wanted and not is_put:
            _write_forces(tree, servos, shapes, schedule.dt, count, state, row, log, w)
        advance_servos(tree, servos, schedule.dt, state, w)
        _integrate(tree, schedule.dt, state, w)
    return DONE
