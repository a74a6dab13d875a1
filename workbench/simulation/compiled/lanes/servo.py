"""The servo bank of several robots at once: `compiled.servo` with masks, without tables.

Names and order are those of `compiled.servo`. The law's duty is one formula here, with a derivative gain or without.
"""

from __future__ import annotations

import math

from workbench.servo.term_bank import LOAD_SMOOTHING, MOVING
from workbench.simulation.compiled.arrays import Ints, Schedule, State, Tree
from workbench.simulation.compiled.kernel import part
from workbench.simulation.compiled.lanes.arrays import LaneServos, Room
from workbench.simulation.compiled.number import LANES, Wide, exponential, least, most, where, wide, with_sign, within

_SMOOTHING, _MOVING = float(LOAD_SMOOTHING), float(MOVING)


@part
def command(schedule: Schedule, k: int, at: Ints, end: Ints, bank: LaneServos, states: State) -> None:
    """The commands of step k, in each lane its own: at (LANES,): the next of each, which moves on; end (LANES,): behind its last.
    One that comes between two steps ramps from then on. Servos are switched on or off in all lanes at once."""
    due = True
    while due:
        due = False
        for l in range(LANES):
            if at[l] < end[l] and schedule.command_step[at[l]] == k:
                due = True
                _hear(schedule, at[l], bank, states, l)
        for l in range(LANES):
            if at[l] < end[l] and schedule.command_step[at[l]] == k:
                for i in range(states.goal.shape[0]):
                    states.on[i] = schedule.on[at[l], i]
                if schedule.late[at[l]] > 0.0:
                    _ramp_on(schedule.late[at[l]], schedule.late[at[l]] / schedule.dt, bank, states, l)
                at[l] += 1


@part
def _hear(schedule: Schedule, c: int, bank: LaneServos, states: State, l: int) -> None:
    """Lane l takes the goals and speeds of command number c, and undoes its ramp since then."""
    late = schedule.late[c]
    share = late / schedule.dt
    for i in range(states.goal.shape[0]):
        goal, lag = states.goal[i, l], bank.lag[i, l]
        if share > 0.0:
            if states.on[i]:
                behind, reach = (states.lagging[i, l] if lag > 0.0 else goal) - states.reference[i, l], states.reach[i, l] * share
                states.reference[i, l] -= min(max(behind, -reach), reach)
            if lag > 0.0:
                passed = 1.0 - math.exp(-late / lag)
                states.lagging[i, l] = (states.lagging[i, l] - passed * goal) / (1.0 - passed)
        states.goal[i, l] = schedule.goal[c, i] + bank.zero[i, l]
        reach = schedule.speed[c, i] * schedule.dt if schedule.speed[c, i] > 0.0 else math.inf
        states.reach[i, l] = min(reach, bank.ramp[i, l] * schedule.dt)


@part
def _ramp_on(late: float, share: float, bank: LaneServos, states: State, l: int) -> None:
    """Lane l ramps to its goals for so long [s]."""
    for i in range(states.goal.shape[0]):
        goal, lag = states.goal[i, l], bank.lag[i, l]
        if lag > 0.0:
            goal = states.lagging[i, l] + (1.0 - math.exp(-late / lag)) * (goal - states.lagging[i, l])
        if states.on[i]:
            reach = states.reach[i, l] * share
            states.reference[i, l] += min(max(goal - states.reference[i, l], -reach), reach)
        states.lagging[i, l] = goal


@part
def _lagging(servos: LaneServos, i: int, state: State, seconds: float) -> Wide:
    """The goal behind its filter after so long."""
    if not servos.lags:
        return state.goal[i]
    passed = 1.0 - exponential(-seconds / servos.lag[i])
    return where(servos.lag[i] > 0.0, state.lagging[i] + passed * (state.goal[i] - state.lagging[i]), state.goal[i])


@part
def put_servos(servos: LaneServos, schedule: Schedule, k: int, state: State) -> None:
    """Moves the servos to recorded state number k; ramps, and joints between servos and links, are unchanged."""
    for i in range(servos.joint.shape[0]):
        j = servos.joint[i]
        if not math.isnan(schedule.put_q[k, i]):
            state.q[j] = schedule.put_q[k, i] + servos.zero[i]
            state.v[j] = schedule.put_qdot[k, i]
            for m in range(4):
                state.memory[m, i] = 0.0
    state.stepped[0] = 0.0


@part
def push_joints(servos: LaneServos, elapsed: float, state: State, w: Room) -> None:
    """Torques on the joints for the step that begins: w.motor, w.push as the plant takes them, w.relief; adds to w.force."""
    drawn = wide(0.0)
    for i in range(servos.joint.shape[0]):
        j = servos.joint[i]
        duty = wide(0.0)
        if state.on[i]:
            duty = _duty(servos, i, state.reference[i] - state.q[j], state.v[j])
        w.motor[i] = duty
        drawn += abs(duty)
    fade = exponential(-servos.fade[0] * elapsed) if servos.terms else wide(1.0)
    for i in range(servos.joint.shape[0]):
        j = servos.joint[i]
        v = state.v[j]
        torque = w.motor[i] * servos.full_torque[i]
        w.relief[i] = 0.0
        if not servos.terms:
            w.push[i] = torque if state.on[i] else servos.back_emf[i] * v
        else:
            for a in range(servos.sag.shape[0]):
                torque *= most(1.0 - servos.sag[a] * drawn / servos.supply[i], 0.0)
            _push_with_terms(servos, i, v, torque * fade, state, w)
        w.force[j] += w.push[i] + w.relief[i]


@part
def _duty(servos: LaneServos, i: int, error: Wide, v: Wide) -> Wide:
    beyond = abs(error) - servos.margin[i]
    duty = where(beyond > 0.0, with_sign(servos.punch[i] + servos.gain[i] * beyond, error), 0.0)
    return within(duty - servos.derivative[i] * v, -1.0, 1.0)


@part
def _push_with_terms(servos: LaneServos, i: int, v: Wide, torque: Wide, state: State, w: Room) -> None:
    ahead = 2.0 * v - state.memory[0, i] if state.stepped[0] > 0.0 else v
    if state.on[i]:
        free_end, now = torque - servos.back_emf[i] * ahead, torque - servos.back_emf[i] * v
        w.push[i] = torque - (free_end - _acting(servos, i, free_end))
        w.motor[i] = _acting(servos, i, now)
    else:
        w.push[i] = servos.back_emf[i] * ahead
        w.motor[i] = 0.0
    if servos.varies:
        w.relief[i] = _relief(servos, i, v, w.motor[i], state)


@part
def _acting(servos: LaneServos, i: int, torque: Wide) -> Wide:
    """What of a motor's torque acts."""
    return within(torque / (1.0 + abs(torque) * servos.bend[i]), -servos.ceiling[i], servos.ceiling[i])


@part
def _relief(servos: LaneServos, i: int, v: Wide, motor: Wide, state: State) -> Wide:
    """The reduction of the plant's friction, along the motion."""
    friction = _friction(servos, i, v, motor, state, within(v / _MOVING, -1.0, 1.0))
    direction = within(v / _MOVING - state.memory[3, i] / most(0.5 * friction, 1e-6), -1.0, 1.0)
    return (servos.most[i] - _friction(servos, i, v, motor, state, direction)) * direction


@part
def _friction(servos: LaneServos, i: int, v: Wide, motor: Wide, state: State, direction: Wide) -> Wide:
    """The dry friction wanted of a joint that turns, or would, in this direction."""
    share = servos.rubbing[i]
    for c in range(servos.still_speed.shape[0]):
        fast = v / servos.still_speed[c]
        share += servos.still[c, i] * exponential(-(fast * fast))
    driven = most(-with_sign(1.0, motor) * direction, 0.0)
    share += where(abs(motor) > 0.0, servos.backwards[i] * driven, 0.0)
    friction = servos.coulomb[i] + share * abs(state.memory[2, i])
    for b in range(servos.speed.shape[0]):
        fast = v / servos.speed[b]
        friction += servos.sticking[b, i] * exponential(-(fast * fast))
    for d in range(servos.lopsided.shape[0]):
        friction *= 1.0 + servos.lopsided[d, i] * direction
    return least(friction, servos.most[i])


@part
def advance_servos(tree: Tree, servos: LaneServos, dt: float, state: State, w: Room) -> None:
    """Ramps and memory over the step whose end's velocities are in w.v_next; the state is still that of its begin."""
    smoothing = dt / (dt + _SMOOTHING)
    for i in range(servos.joint.shape[0]):
        j = servos.joint[i]
        v = state.v[j]
        goal = _lagging(servos, i, state, dt)
        state.lagging[i] = goal
        if state.on[i]:
            state.reference[i] += within(goal - state.reference[i], -state.reach[i], state.reach[i])
        else:  # the ramp starts at the measured position once torque is back
            state.reference[i] = state.q[j]
        if servos.varies:
            rate = tree.armature[j] / dt
            if state.stepped[0] > 0.0:
                handed = state.memory[1, i] - (tree.damping[j] + rate) * v
                state.memory[2, i] += smoothing * (handed - state.memory[2, i])
            braking = within(-w.brake_gain[j] * w.v_next[j], -tree.brake[j], tree.brake[j])
            friction = braking + w.relief[i]
            state.memory[1, i] = w.push[i] + friction + rate * v
            state.memory[3, i] = friction
        state.memory[0, i] = v
    state.stepped[0] = 1.0
