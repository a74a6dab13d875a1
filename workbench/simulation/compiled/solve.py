"""Drake's discrete step as a convex problem in the next velocities, and its solution by Newton with an exact line search.

    least over v:  1/2 |v - v*|^2_A + sum of the constraints' costs in their velocities J v

A. Castro, F. Permenter, X. Han, "An Unconstrained Convex Formulation of Compliant Contact", IEEE T-RO 2023 (the solver, its
stopping criteria, near-rigid constraints), and A. Castro, X. Han, J. Masterjohn, "A Theory of Irrotational Contact Fields", 2024
(lagged friction). Steps, tolerances and their order are those of Drake's SAP, so that a solution is Drake's to rounding, even
where it stops short of the minimum.
"""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import State, Tree, Work
from workbench.simulation.compiled.contact import along, deepest
from workbench.simulation.compiled.cost import (
    COST_ABSOLUTE,
    COST_RELATIVE,
    MOST_ITERATIONS,
    cost_along,
    limit_impulse,
    normal_impulse,
    step_length,
)
from workbench.simulation.compiled.kernel import part, rare
from workbench.simulation.compiled.number import LANES, put_stretch, stretch
from workbench.simulation.compiled.rows import copy_rows, factor_rows, solve_rows, times_rows
from workbench.simulation.compiled.tree import factor, solve_factored
from workbench.simulation.compiled.vectors import Three, clamp

STICTION = 1e-4
"""Slip speed below which a contact sticks [m/s]: MultibodyPlant's default stiction tolerance."""
SIGMA = 1e-3
"""Softening of friction by the weight that a contact feels, dimensionless."""
NEAR_RIGID = 0.1**2 / (4.0 * math.pi**2)
"""beta^2/(4 pi^2) with beta = 0.1: constraints are no stiffer than a period of 0.1 steps."""
LIMIT_STIFFNESS = 1e12
"""Of joints' limits [N m/rad]: always near rigid."""
LIMIT_WINDOW = 2.0
"""Limits farther away than this many steps' travel are left out."""
RELATIVE, ABSOLUTE = 1e-6, 1e-14
"""Of the momentum's balance, as shares of momentum and in sqrt(J)."""


@part
def prepare(tree: Tree, state: State, dt: float, count: int, w: Work) -> None:
    """Free motion v*, the constraints there are and their constants, from M, forces and contacts."""
    n = tree.parent.shape[0]
    o = 6 if tree.free else 0
    copy_rows(tree, w.M, w.H)
    factor_rows(tree, w.H, w.pivot)
    for k in range(tree.path.shape[0]):
        w.v_star[k] = w.force[k]
        w.scale[k] = 1.0 / math.sqrt(w.M[k, tree.depth[k]])
    solve_rows(tree, w.H, w.pivot, w.v_star)
    for k in range(tree.path.shape[0]):
        w.v_star[k] = state.v[k] + dt * w.v_star[k]
    for g in range(w.active.shape[0]):
        w.active[g] = False
    for i in range(n):
        _prepare_joint(tree, state, i, o + i, dt, w)
    for c in range(count):
        w.active[tree.group[w.last[c]]] = True
        if w.other[c] >= 0:
            w.active[tree.group[w.other[c]]] = True
        w.soft[c] = max(STICTION, w.friction[c] * SIGMA * _weight(tree, c, w) * w.normal[c])
    for k in range(tree.path.shape[0]):  # trees without constraints move freely
        w.v_next[k] = state.v[k] if w.active[tree.group[k]] else w.v_star[k]


@part
def _prepare_joint(tree: Tree, state: State, i: int, k: int, dt: float, w: Work) -> None:
    """Dry friction and limits of one joint."""
    near_rigid = NEAR_RIGID / w.M[k, tree.depth[k]]
    if tree.brake[i] > 0.0:
        w.brake_gain[i] = tree.brake_gain[i] if 1.0 / (dt * tree.brake_gain[i]) >= near_rigid else 1.0 / (dt * near_rigid)
        w.active[tree.group[k]] = True
    window = LIMIT_WINDOW * dt * max(abs(state.v[k]), abs(w.v_star[k]))
    w.limit_on[i, 0] = tree.lower[i] >= state.q[i] - window
    w.limit_on[i, 1] = tree.upper[i] <= state.q[i] + window
    if w.limit_on[i, 0] or w.limit_on[i, 1]:
        w.active[tree.group[k]] = True
        w.limit_R[i] = max(near_rigid, 1.0 / (dt * LIMIT_STIFFNESS * (dt + dt)))
        w.limit_v[i, 0] = -(state.q[i] - tree.lower[i]) / (dt + dt)
        w.limit_v[i, 1] = -(tree.upper[i] - state.q[i]) / (dt + dt)


@part
def _weight(tree: Tree, c: int, w: Work) -> float:
    """Norm over three of J diag(A)^-1 J' of a contact."""
    of = tree.number if w.other[c] >= 0 else tree.above[w.last[c]]
    xx = xy = yy = xz = yz = zz = 0.0
    t = int(deepest(tree, c, w))
    while True:  # there is at least one
        x, y, z, scale = w.J[c, 0, t], w.J[c, 1, t], w.J[c, 2, t], w.scale[of[t]]
        xx += x * x * scale * scale
        xy += y * x * scale * scale
        yy += y * y * scale * scale
        xz += z * x * scale * scale
        yz += z * y * scale * scale
        zz += z * z * scale * scale
        if t == 0:
            break
        t -= 1
    total = xx * xx
    total += 2.0 * xy * xy
    total += yy * yy
    total += 2.0 * xz * xz
    total += 2.0 * yz * yz
    total += zz * zz
    return math.sqrt(total) / 3.0


@part
def _gradient(tree: Tree, dt: float, count: int, w: Work) -> tuple[float, float]:
    """w.gradient = A (v - v*) - J' impulses, w.impulse = J' impulses, w.hessian of contacts (xx, xy, yy, zz); returns the
    residual and the scale of momentum."""
    o = 6 if tree.free else 0
    for k in range(tree.path.shape[0]):
        w.impulse[k] = 0.0
    for i in range(tree.parent.shape[0]):
        v = w.v_next[o + i]
        if tree.brake[i] > 0.0:
            w.impulse[o + i] += dt * clamp(-w.brake_gain[i] * v, -tree.brake[i], tree.brake[i])
        if w.limit_on[i, 0]:
            w.impulse[o + i] += limit_impulse(w, i, 0, v)
        if w.limit_on[i, 1]:
            w.impulse[o + i] -= limit_impulse(w, i, 1, -v)
    for c in range(count):
        _push_contact(tree, c, dt, w)
    residual = momentum = impulse = 0.0
    for k in range(tree.path.shape[0]):
        if w.active[tree.group[k]]:
            w.gradient[k] = w.momentum[k] - w.momentum_star[k] - w.impulse[k]
            residual += (w.scale[k] * w.gradient[k]) ** 2
            momentum += (w.scale[k] * w.momentum[k]) ** 2
            impulse += (w.scale[k] * w.impulse[k]) ** 2
        else:
            w.gradient[k] = 0.0
    return math.sqrt(residual), math.sqrt(max(momentum, impulse))


@part
def _push_contact(tree: Tree, c: int, dt: float, w: Work) -> None:
    """Adds J' times a contact's impulse to w.impulse; its part of the Hessian."""
    x, y = w.vc[c, 0], w.vc[c, 1]
    per_speed = w.friction[c] * w.normal[c] / math.sqrt(x * x + y * y + w.soft[c] * w.soft[c])
    share = 1.0 / (x * x + y * y + w.soft[c] * w.soft[c])
    normal, slope = normal_impulse(w, c, w.vc[c, 2], dt)
    w.hessian[c, 0] = per_speed * (1.0 - x * x * share)
    w.hessian[c, 1] = -per_speed * x * y * share
    w.hessian[c, 2] = per_speed * (1.0 - y * y * share)
    w.hessian[c, 3] = slope
    of = tree.number if w.other[c] >= 0 else tree.above[w.last[c]]
    for t in range(deepest(tree, c, w), -1, -1):
        w.impulse[of[t]] += w.J[c, 2, t] * normal - per_speed * (w.J[c, 0, t] * x + w.J[c, 1, t] * y)


@part
def _direction(tree: Tree, dt: float, count: int, w: Work) -> float:
    """w.dv = -H^-1 gradient, w.dp = A dv, w.dvc = J dv; returns dv' A dv."""
    o = 6 if tree.free else 0
    copy_rows(tree, w.M, w.H)
    for i in range(tree.parent.shape[0]):
        v, t = w.v_next[o + i], tree.depth[o + i]
        if tree.brake[i] > 0.0 and abs(w.brake_gain[i] * v) <= tree.brake[i]:
            w.H[o + i, t] += dt * w.brake_gain[i]
        if w.limit_on[i, 0] and w.limit_v[i, 0] - v > 0.0:
            w.H[o + i, t] += 1.0 / w.limit_R[i]
        if w.limit_on[i, 1] and w.limit_v[i, 1] + v > 0.0:
            w.H[o + i, t] += 1.0 / w.limit_R[i]
    for k in range(tree.path.shape[0]):
        w.dv[k] = -w.gradient[k]
    if w.crossed[0]:
        _solve_crossed(tree, count, w)
    else:
        for c in range(count):
            _stiffen(tree, c, w)
        factor_rows(tree, w.H, w.pivot)
        solve_rows(tree, w.H, w.pivot, w.dv)
    times_rows(tree, w.M, w.dv, w.dp)
    for c in range(count):
        w.dvc[c, 0], w.dvc[c, 1], w.dvc[c, 2] = along(tree, c, w.dv, w)
    curve = 0.0
    for k in range(tree.path.shape[0]):
        curve += w.dv[k] * w.dp[k]
    return curve


@part
def _stiffen(tree: Tree, c: int, w: Work) -> None:
    """H += J' G J of a contact."""
    deep, J = tree.depth[w.last[c]], w.J[c]
    for u in range(0, deep + 1, LANES):
        a, b, d = stretch(J, 0, u), stretch(J, 1, u), stretch(J, 2, u)
        for t in range(u, deep + 1):
            x, y, z = _stiffness(c, t, w)
            j = tree.above[w.last[c], t]
            put_stretch(w.H, j, u, stretch(w.H, j, u) + (x * a + y * b + z * d))


@part
def _stiffness(c: int, t: int, w: Work) -> Three:
    """G times column t of a contact's Jacobian."""
    return (w.hessian[c, 0] * w.J[c, 0, t] + w.hessian[c, 1] * w.J[c, 1, t],
            w.hessian[c, 1] * w.J[c, 0, t] + w.hessian[c, 2] * w.J[c, 1, t], w.hessian[c, 3] * w.J[c, 2, t])


@rare
def _solve_crossed(tree: Tree, count: int, w: Work) -> None:
    """w.dv := H^-1 w.dv, where a contact lies between two branches; H is without contacts yet."""
    for j in range(tree.depth.shape[0]):
        for i in range(j):
            w.whole[j, i] = 0.0
        for t in range(tree.depth[j] + 1):
            w.whole[j, tree.above[j, t]] = w.H[j, t]
    for c in range(count):
        of = tree.number if w.other[c] >= 0 else tree.above[w.last[c]]
        for t in range(deepest(tree, c, w), -1, -1):
            x, y, z = _stiffness(c, t, w)
            for u in range(t + 1):
                w.whole[of[t], of[u]] += x * w.J[c, 0, u] + y * w.J[c, 1, u] + z * w.J[c, 2, u]
    factor(tree.number, tree.every, w.whole)
    solve_factored(tree.number, tree.every, w.whole, w.dv)


@part
def solve(tree: Tree, dt: float, count: int, w: Work) -> int:
    """From w.v_next, the guess, to the velocities at the step's end; returns how many iterations it took, -1 if it failed."""
    anything = False
    for g in range(w.active.shape[0]):
        anything |= w.active[g]
    if not anything:
        return 0
    times_rows(tree, w.M, w.v_star, w.momentum_star)
    times_rows(tree, w.M, w.v_next, w.momentum)
    cost = _cost_here(tree, dt, count, w)
    stalled = False
    for iteration in range(MOST_ITERATIONS + 1):
        residual, scale = _gradient(tree, dt, count, w)
        if stalled or residual <= ABSOLUTE + RELATIVE * scale:
            return iteration
        if iteration == MOST_ITERATIONS or not residual < math.inf:
            break
        curve = _direction(tree, dt, count, w)
        alpha = step_length(tree, dt, count, curve, cost, w)
        for k in range(tree.path.shape[0]):
            w.v_next[k] += alpha * w.dv[k]
            w.momentum[k] += alpha * w.dp[k]
        for c in range(count):
            for r in range(3):
                w.vc[c, r] += alpha * w.dvc[c, r]
        before = cost
        cost = _cost_here(tree, dt, count, w)
        stalled = abs(before - cost) < COST_ABSOLUTE + COST_RELATIVE * 0.5 * (abs(before) + abs(cost)) and alpha > 0.5
    return -1


@part
def _cost_here(tree: Tree, dt: float, count: int, w: Work) -> float:
    return cost_along(tree, dt, count, 0.0, w)
