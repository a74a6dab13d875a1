"""The servo bank, as `workbench.servo` has it for discrete plants: ramp, law, and what servos do beyond the law.

Names and order are those of `ServoBank` and `TermBank`, where each step is explained.
"""

from __future__ import annotations

import math

from workbench.servo.tabled import ANGLE_DIRECTION, DUTY, DUTY_DIRECTION, SPEED, TURNING
from workbench.servo.term_bank import LOAD_SMOOTHING, MOVING
from workbench.simulation.compiled.arrays import Schedule, Servos, State, Tree, Work
from workbench.simulation.compiled.kernel import part
from workbench.simulation.compiled.vectors import INFINITY, clamp

_SMOOTHING = float(LOAD_SMOOTHING)
_MOVING = float(MOVING)
_TURNING = float(TURNING)
_ANGLE_DIRECTION, _DUTY, _DUTY_DIRECTION, _SPEED = ANGLE_DIRECTION, DUTY, DUTY_DIRECTION, SPEED


@part
def command(schedule: Schedule, k: int, servos: Servos, state: State) -> None:
    """Command number k comes; one that comes between two steps ramps from then on."""
    share = schedule.late[k] / schedule.dt
    if share > 0.0:
        _shift_ramp(servos, state, schedule.late[k], share, -1.0)
    for i in range(state.goal.shape[0]):
        state.goal[i] = schedule.goal[k, i] + servos.zero[i]
        reach = schedule.speed[k, i] * schedule.dt if schedule.speed[k, i] > 0.0 else INFINITY
        state.reach[i] = min(reach, servos.ramp[i] * schedule.dt)
        state.on[i] = schedule.on[k, i]
    if share > 0.0:
        _shift_ramp(servos, state, schedule.late[k], share, 1.0)


@part
def _shift_ramp(servos: Servos, state: State, late: float, share: float, sign: float) -> None:
    for i in range(state.goal.shape[0]):
        goal = _lagging(servos, i, state, late) if sign > 0.0 else state.lagging[i]
        goal = goal if servos.lag[i] > 0.0 else state.goal[i]
        if state.on[i]:
            reach = state.reach[i] * share
            state.reference[i] += sign * clamp(goal - state.reference[i], -reach, reach)
        if sign > 0.0:
            state.lagging[i] = goal
        elif servos.lag[i] > 0.0:
            passed = -math.expm1(-late / servos.lag[i])
            state.lagging[i] = (state.lagging[i] - passed * state.goal[i]) / (1.0 - passed)


@part
def _lagging(servos: Servos, i: int, state: State, seconds: float) -> float:
    """The goal behind its filter after so long."""
    if servos.lag[i] > 0.0:
        return state.lagging[i] - math.expm1(-seconds / servos.lag[i]) * (state.goal[i] - state.lagging[i])
    return state.goal[i]


@part
def push_joints(servos: Servos, elapsed: float, free: int, state: State, w: Work) -> None:
    """Torques on the joints for the step that begins: w.motor, w.push as the plant takes them, w.relief; adds to w.force.
    free: velocities before the joints'."""
    if servos.terms:
        _push_with_terms(servos, elapsed, free, state, w)
    else:
        _push(servos, free, state, w)
    for i in range(servos.joint.shape[0]):
        w.force[free + servos.joint[i]] += w.push[i] + w.relief[i]


@part
def _push(servos: Servos, free: int, state: State, w: Work) -> None:
    for i in range(servos.joint.shape[0]):
        j = servos.joint[i]
        v = state.v[free + j]
        error = state.reference[i] - state.q[j]
        size = abs(error)
        slope = servos.gain[i] * servos.full_torque[i]
        torque = 0.0
        if size > servos.margin[i]:
            offset = servos.punch[i] * servos.full_torque[i] - slope * servos.margin[i]
            torque = math.copysign(min(offset + slope * size, servos.full_torque[i]), error)
        if servos.derivative[i] != 0.0:
            torque = _duty(servos, i, error, v) * servos.full_torque[i]
        if state.on[i]:
            w.push[i], w.motor[i] = torque, torque - servos.back_emf[i] * v
        else:  # no back-EMF either: undo the joint's share of damping
            w.push[i], w.motor[i] = servos.back_emf[i] * v, 0.0
        w.relief[i] = 0.0


@part
def _duty(servos: Servos, i: int, error: float, v: float) -> float:
    beyond = abs(error) - servos.margin[i]
    duty = math.copysign(servos.punch[i] + servos.gain[i] * beyond, error) if beyond > 0.0 else 0.0
    return clamp(duty - servos.derivative[i] * v, -1.0, 1.0)


@part
def _push_with_terms(servos: Servos, elapsed: float, free: int, state: State, w: Work) -> None:
    drawn = 0.0
    for i in range(servos.joint.shape[0]):
        j = servos.joint[i]
        duty = _duty(servos, i, state.reference[i] - state.q[j], state.v[free + j]) if state.on[i] else 0.0
        w.motor[i] = duty
        drawn += abs(duty)
    fade = math.exp(-servos.fade * elapsed) if servos.fade > 0.0 else 1.0
    for i in range(servos.joint.shape[0]):
        v = state.v[free + servos.joint[i]]
        torque, tabled = w.motor[i] * servos.full_torque[i], 0.0
        for t in range(servos.table_servo.shape[0]):
            if servos.table_servo[t] == i:
                tabled += _tabled(servos, t, state.q[servos.joint[i]], v, w.motor[i])
        for a in range(servos.sag.shape[0]):
            torque *= max(1.0 - servos.sag[a] * drawn / servos.supply[i], 0.0)
        torque *= fade
        ahead = 2.0 * v - state.memory[0, i] if state.stepped[0] > 0.0 else v
        if state.on[i]:
            free_end, now = torque - servos.back_emf[i] * ahead, torque - servos.back_emf[i] * v
            w.push[i] = torque - (free_end - _acting(servos, i, free_end))
            w.motor[i] = _acting(servos, i, now)
        else:
            w.push[i], w.motor[i] = servos.back_emf[i] * ahead, 0.0
        w.push[i] += tabled
        w.relief[i] = _relief(servos, i, v, w.motor[i], state) if servos.varies else 0.0


@part
def _tabled(servos: Servos, t: int, angle: float, v: float, duty: float) -> float:
    """The torque of one table."""
    kind = servos.table_of[t]
    x = angle
    if kind == _DUTY:
        x = duty
    elif kind == _DUTY_DIRECTION:
        x = abs(duty)
    elif kind == _SPEED:
        x = v
    low, high = 0, servos.table_at.shape[1]  # the first knot beyond x is among them
    while low < high:
        middle = (low + high) // 2
        if servos.table_at[t, middle] <= x:
            low = middle + 1
        else:
            high = middle
    if low == 0:
        value = servos.table_torque[t, 0]
    elif low == servos.table_at.shape[1]:
        value = servos.table_torque[t, low - 1]
    else:
        share = (x - servos.table_at[t, low - 1]) / (servos.table_at[t, low] - servos.table_at[t, low - 1])
        value = servos.table_torque[t, low - 1] + share * (servos.table_torque[t, low] - servos.table_torque[t, low - 1])
    if kind in (_ANGLE_DIRECTION, _DUTY_DIRECTION):
        value *= v / math.sqrt(v * v + _TURNING * _TURNING)
    return value


@part
def _acting(servos: Servos, i: int, torque: float) -> float:
    """What of a motor's torque acts."""
    return clamp(torque / (1.0 + abs(torque) * servos.bend[i]), -servos.ceiling[i], servos.ceiling[i])


@part
def _relief(servos: Servos, i: int, v: float, motor: float, state: State) -> float:
    """The reduction of the plant's friction, along the motion."""
    friction = _friction(servos, i, v, motor, state, clamp(v / _MOVING, -1.0, 1.0))
    direction = clamp(v / _MOVING - state.memory[3, i] / max(0.5 * friction, 1e-6), -1.0, 1.0)
    return (servos.most[i] - _friction(servos, i, v, motor, state, direction)) * direction


@part
def _friction(servos: Servos, i: int, v: float, motor: float, state: State, direction: float) -> float:
    """The dry friction wanted of a joint that turns, or would, in this direction."""
    share = servos.rubbing[i]
    for c in range(servos.still_speed.shape[0]):
        if servos.still[c, i] > 0.0:
            share += servos.still[c, i] * math.exp(-((v / servos.still_speed[c]) ** 2))
    if servos.backwards[i] > 0.0 and motor != 0.0:
        share += servos.backwards[i] * max(-math.copysign(1.0, motor) * direction, 0.0)
    friction = servos.coulomb[i] + share * abs(state.memory[2, i])
    for b in range(servos.speed.shape[0]):
        if servos.sticking[b, i] > 0.0:
            friction += servos.sticking[b, i] * math.exp(-((v / servos.speed[b]) ** 2))
    for d in range(servos.lopsided.shape[0]):
        friction *= 1.0 + servos.lopsided[d, i] * direction
    return min(friction, servos.most[i])


@part
def advance_servos(tree: Tree, servos: Servos, dt: float, state: State, w: Work) -> None:
    """Ramps and memory over the step whose end's velocities are in w.v_next; the state is still that of its begin."""
    free = 6 if tree.free else 0
    smoothing = dt / (dt + _SMOOTHING)
    for i in range(servos.joint.shape[0]):
        j = servos.joint[i]
        v = state.v[free + j]
        goal = _lagging(servos, i, state, dt)
        state.lagging[i] = goal
        if state.on[i]:
            state.reference[i] += clamp(goal - state.reference[i], -state.reach[i], state.reach[i])
        else:  # the ramp starts at the measured position once torque is back
            state.reference[i] = state.q[j]
        if servos.varies:
            rate = tree.armature[j] / dt
            if state.stepped[0] > 0.0:
                handed = state.memory[1, i] - (tree.damping[j] + rate) * v
                state.memory[2, i] += smoothing * (handed - state.memory[2, i])
            friction = braking(tree, w, j, w.v_next[free + j]) + w.relief[i]
            state.memory[1, i] = w.push[i] + friction + rate * v
            state.memory[3, i] = friction
        state.memory[0, i] = v
    state.stepped[0] = 1.0


@part
def braking(tree: Tree, w: Work, j: int, v: float) -> float:
    """Torque of a joint's dry friction at velocity v at the step's end, as the plant's actuator gives it."""
    return clamp(-w.brake_gain[j] * v, -tree.brake[j], tree.brake[j])
