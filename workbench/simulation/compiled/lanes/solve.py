"""Drake's discrete step of held robots, several at once: `compiled.solve` with masks, without contacts.

Names, order and stopping rules are those of `compiled.solve`, where each step is explained. Each lane stops where it would alone,
and then waits for the others.
"""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import State, Tree
from workbench.simulation.compiled.cost import COST_ABSOLUTE, COST_RELATIVE, LINE_TOLERANCE, LONGEST_STEP, MOST_ITERATIONS
from workbench.simulation.compiled.kernel import part
from workbench.simulation.compiled.lanes.arrays import Room
from workbench.simulation.compiled.number import Mask, Wide, anywhere, least, most, where, wide, within
from workbench.simulation.compiled.solve import ABSOLUTE, LIMIT_STIFFNESS, LIMIT_WINDOW, NEAR_RIGID, RELATIVE
from workbench.simulation.compiled.tree import copy_matrix, factor, solve_factored, times_matrix


@part
def prepare(tree: Tree, dt: float, state: State, w: Room) -> bool:
    """Free motion v*, and the constants of friction and limits; whether any joint of any lane is near a limit. A limit that is
    far is one that is met at a velocity of minus infinity."""
    n = tree.parent.shape[0]
    copy_matrix(tree, w.M, w.H)
    factor(tree.depth, tree.above, w.H)
    for k in range(n):
        w.v_star[k] = w.force[k]
        w.scale[k] = 1.0 / math.sqrt(w.M[k, tree.depth[k]])
    solve_factored(tree.depth, tree.above, w.H, w.v_star)
    for g in range(w.active.shape[0]):
        w.active[g] = 0.0
    near_any = wide(0.0)
    for k in range(n):
        w.v_star[k] = state.v[k] + dt * w.v_star[k]
        near_rigid = NEAR_RIGID / w.M[k, tree.depth[k]]
        w.brake_gain[k] = where(1.0 / (dt * tree.brake_gain[k]) >= near_rigid, tree.brake_gain[k], 1.0 / (dt * near_rigid))
        window = LIMIT_WINDOW * dt * most(abs(state.v[k]), abs(w.v_star[k]))
        low, high = tree.lower[k] >= state.q[k] - window, tree.upper[k] <= state.q[k] + window
        w.limit_v[k, 0] = where(low, -(state.q[k] - tree.lower[k]) / (dt + dt), -math.inf)
        w.limit_v[k, 1] = where(high, -(tree.upper[k] - state.q[k]) / (dt + dt), -math.inf)
        w.limit_R[k] = most(near_rigid, 1.0 / (dt * LIMIT_STIFFNESS * (dt + dt)))
        near_any = where(low | high, 1.0, near_any)
        w.active[tree.group[k]] = where((tree.brake[k] > 0.0) | low | high, 1.0, w.active[tree.group[k]])
    for k in range(n):
        w.v_next[k] = where(w.active[tree.group[k]] > 0.0, state.v[k], w.v_star[k])
    return anywhere(near_any > 0.0)


@part
def _limit_impulse(w: Room, i: int, side: int, v: Wide) -> Wide:
    return most((w.limit_v[i, side] - v) / w.limit_R[i], 0.0)


@part
def _gradient(tree: Tree, dt: float, limits: bool, w: Room) -> tuple[Wide, Wide]:
    residual = wide(0.0)
    momentum = wide(0.0)
    impulse = wide(0.0)
    for k in range(tree.parent.shape[0]):
        v = w.v_next[k]
        push = dt * within(-w.brake_gain[k] * v, -tree.brake[k], tree.brake[k])
        if limits:
            push += _limit_impulse(w, k, 0, v)
            push -= _limit_impulse(w, k, 1, -v)
        on = w.active[tree.group[k]] > 0.0
        w.gradient[k] = where(on, w.momentum[k] - w.momentum_star[k] - push, 0.0)
        a, b, c = w.scale[k] * w.gradient[k], where(on, w.scale[k] * w.momentum[k], 0.0), w.scale[k] * push
        residual += a * a
        momentum += b * b
        impulse += c * c
    return math.sqrt(residual), math.sqrt(most(momentum, impulse))


@part
def _cost(tree: Tree, dt: float, limits: bool, alpha: Wide, w: Room) -> Wide:
    cost = wide(0.0)
    for k in range(tree.parent.shape[0]):
        v = w.v_next[k] + alpha * w.dv[k]
        cost += 0.5 * (v - w.v_star[k]) * (w.momentum[k] - w.momentum_star[k] + alpha * w.dp[k])
        y, most_torque = abs(w.brake_gain[k] * v), tree.brake[k]
        slip = where(y < most_torque, 0.5 * y * y, most_torque * (y - 0.5 * most_torque))
        cost += where(most_torque > 0.0, dt / w.brake_gain[k] * slip, 0.0)
        if limits:
            low, high = _limit_impulse(w, k, 0, v), _limit_impulse(w, k, 1, -v)
            cost += 0.5 * w.limit_R[k] * low * low
            cost += 0.5 * w.limit_R[k] * high * high
    return cost


@part
def _slope(tree: Tree, dt: float, limits: bool, alpha: Wide, curve: Wide, w: Room) -> tuple[Wide, Wide]:
    first = wide(0.0)
    second = curve
    for k in range(tree.parent.shape[0]):
        dv = w.dv[k]
        v = w.v_next[k] + alpha * dv
        first += w.dp[k] * (v - w.v_star[k])
        y = -w.brake_gain[k] * v
        second += where(abs(y) <= tree.brake[k], dt * w.brake_gain[k] * dv * dv, 0.0)
        first -= dt * within(y, -tree.brake[k], tree.brake[k]) * dv
        if limits:
            first -= _limit_impulse(w, k, 0, v) * dv
            first += _limit_impulse(w, k, 1, -v) * dv
            second += where(w.limit_v[k, 0] - v > 0.0, dv * dv / w.limit_R[k], 0.0)
            second += where(w.limit_v[k, 1] + v > 0.0, dv * dv / w.limit_R[k], 0.0)
    return first, second


@part
def _direction(tree: Tree, dt: float, limits: bool, w: Room) -> Wide:
    n = tree.parent.shape[0]
    copy_matrix(tree, w.M, w.H)
    for k in range(n):
        v = w.v_next[k]
        w.H[k, tree.depth[k]] += where(abs(w.brake_gain[k] * v) <= tree.brake[k], dt * w.brake_gain[k], 0.0)
        if limits:
            w.H[k, tree.depth[k]] += where(w.limit_v[k, 0] - v > 0.0, 1.0 / w.limit_R[k], 0.0)
            w.H[k, tree.depth[k]] += where(w.limit_v[k, 1] + v > 0.0, 1.0 / w.limit_R[k], 0.0)
        w.dv[k] = -w.gradient[k]
    factor(tree.depth, tree.above, w.H)
    solve_factored(tree.depth, tree.above, w.H, w.dv)
    times_matrix(tree, w.M, w.dv, w.dp)
    curve = wide(0.0)
    for k in range(n):
        curve += w.dv[k] * w.dp[k]
    return curve


@part
def _step_length(tree: Tree, dt: float, limits: bool, curve: Wide, todo: Mask, w: Room) -> Wide:
    """In the lanes of `todo`; in the others any number."""
    falls = wide(0.0)
    for k in range(tree.parent.shape[0]):
        falls -= w.gradient[k] * w.dv[k]
    slope, curvature = _slope(tree, dt, limits, wide(LONGEST_STEP), curve, w)
    searched = todo & ~(slope <= 0.0)
    tiny = searched & (falls < COST_ABSOLUTE + COST_RELATIVE * _cost(tree, dt, limits, wide(LONGEST_STEP), w))
    searched = searched & ~tiny & ~(slope / falls < LINE_TOLERANCE)
    guess = least(falls / curvature, LONGEST_STEP)
    at = where(searched, guess, where(tiny, 1.0, LONGEST_STEP))
    low = wide(0.0)
    high = wide(LONGEST_STEP)
    change = low - high
    before = change
    for _ in range(MOST_ITERATIONS):
        if not anywhere(searched):
            break
        slope, curvature = _slope(tree, dt, limits, at, curve, w)
        slope, curvature = slope / falls, curvature / falls
        low = where(slope < 0.0, at, low)
        high = where(slope < 0.0, high, at)
        searched = searched & ~(abs(slope) < LINE_TOLERANCE)
        fast = 2.0 * abs(slope) <= abs(before * curvature)
        newton = slope / curvature
        good = fast & (low <= at - newton) & (at - newton <= high)
        half = 0.5 * (low - high)
        before = change
        change = where(good, newton, half)
        at = where(searched, where(good, at - newton, low - half), at)
        searched = searched & ~(abs(change) < LINE_TOLERANCE * guess)
    return at


@part
def solve(tree: Tree, dt: float, limits: bool, gone: Mask, w: Room) -> Mask:
    """From w.v_next, the guess, to the velocities at the step's end. limits: whether any is near. gone: lanes that no
    longer matter; returned with those that did not converge."""
    n = tree.parent.shape[0]
    times_matrix(tree, w.M, w.v_star, w.momentum_star)
    times_matrix(tree, w.M, w.v_next, w.momentum)
    for k in range(n):
        w.dv[k] = 0.0
        w.dp[k] = 0.0
    cost = _cost(tree, dt, limits, wide(0.0), w)
    todo = ~gone
    for _ in range(MOST_ITERATIONS + 1):
        residual, scale = _gradient(tree, dt, limits, w)
        todo = todo & ~(residual <= ABSOLUTE + RELATIVE * scale)
        if not anywhere(todo):
            return gone
        lost = todo & ~(residual < math.inf)
        gone, todo = gone | lost, todo & ~lost
        curve = _direction(tree, dt, limits, w)
        alpha = where(todo, _step_length(tree, dt, limits, curve, todo, w), 0.0)
        for k in range(n):
            w.v_next[k] += alpha * w.dv[k]
            w.momentum[k] += alpha * w.dp[k]
        before = cost
        cost = _cost(tree, dt, limits, wide(0.0), w)
        stalled = abs(before - cost) < COST_ABSOLUTE + COST_RELATIVE * 0.5 * (abs(before) + abs(cost))
        todo = todo & ~(stalled & (alpha > 0.5))
    return gone | todo
