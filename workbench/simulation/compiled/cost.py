"""The cost of a step's problem, along a direction, and where it is least; the problem is stated in `solve`."""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import Tree, Work
from workbench.simulation.compiled.kernel import part
from workbench.simulation.compiled.vectors import clamp

COST_RELATIVE, COST_ABSOLUTE = 1e-15, 1e-30
MOST_ITERATIONS = 100
LONGEST_STEP = 1.5
LINE_TOLERANCE = 1e-8


@part
def limit_impulse(w: Work, i: int, side: int, v: float) -> float:
    """Of one end of a joint that comes towards it at -v, not negative."""
    return max((w.limit_v[i, side] - v) / w.limit_R[i], 0.0)


@part
def normal_impulse(w: Work, c: int, v: float, dt: float) -> tuple[float, float]:
    """Impulse of a contact at normal velocity v, and minus its slope (Hunt-Crossley, implicit)."""
    force, damping = w.elastic[c] - dt * w.stiffness[c] * v, 1.0 - w.dissipation[c] * v
    if force <= 0.0 or damping <= 0.0:
        return 0.0, 0.0
    return dt * force * damping, dt * (w.stiffness[c] * dt * damping + w.dissipation[c] * force)


@part
def cost_along(tree: Tree, dt: float, count: int, alpha: float, w: Work) -> float:
    """The cost at v + alpha dv."""
    o = 6 if tree.free else 0
    cost = 0.0
    for k in range(tree.path.shape[0]):
        if w.active[tree.group[k]]:
            gain = w.momentum[k] - w.momentum_star[k] + alpha * w.dp[k]
            cost += 0.5 * (w.v_next[k] + alpha * w.dv[k] - w.v_star[k]) * gain
    for i in range(tree.parent.shape[0]):
        v = w.v_next[o + i] + alpha * w.dv[o + i]
        if tree.brake[i] > 0.0:
            y = abs(w.brake_gain[i] * v)
            cost += dt / w.brake_gain[i] * (0.5 * y * y if y < tree.brake[i] else tree.brake[i] * (y - 0.5 * tree.brake[i]))
        if w.limit_on[i, 0]:
            cost += 0.5 * w.limit_R[i] * limit_impulse(w, i, 0, v) ** 2
        if w.limit_on[i, 1]:
            cost += 0.5 * w.limit_R[i] * limit_impulse(w, i, 1, -v) ** 2
    for c in range(count):
        cost += _contact_cost(c, dt, alpha, w)
    return cost


@part
def _contact_cost(c: int, dt: float, alpha: float, w: Work) -> float:
    """Antiderivatives of the impulses: of the normal's, constant from where it has ended, and of lagged friction's."""
    k, d, elastic = w.stiffness[c], w.dissipation[c], w.elastic[c]
    x, y, z = w.vc[c, 0] + alpha * w.dvc[c, 0], w.vc[c, 1] + alpha * w.dvc[c, 1], w.vc[c, 2] + alpha * w.dvc[c, 2]
    z = min(z, elastic / dt / (k + 1e-20), 1.0 / (d + 1e-20))
    change = -dt * k * z
    normal = dt * (z * (elastic + 0.5 * change) - 0.5 * d * z * z * (elastic + 2.0 / 3.0 * change))
    slip = math.sqrt(x * x + y * y + w.soft[c] * w.soft[c]) - w.soft[c]
    return w.friction[c] * w.normal[c] * slip - normal


@part
def _slope(tree: Tree, dt: float, count: int, alpha: float, curve: float, w: Work) -> tuple[float, float]:
    """First and second derivative of the cost along dv. curve: dv' A dv."""
    o = 6 if tree.free else 0
    first, second = 0.0, curve
    for k in range(tree.path.shape[0]):
        first += w.dp[k] * (w.v_next[k] + alpha * w.dv[k] - w.v_star[k])
    for i in range(tree.parent.shape[0]):
        dv = w.dv[o + i]
        v = w.v_next[o + i] + alpha * dv
        if tree.brake[i] > 0.0:
            y = -w.brake_gain[i] * v
            if abs(y) <= tree.brake[i]:
                second += dt * w.brake_gain[i] * dv * dv
            first -= dt * clamp(y, -tree.brake[i], tree.brake[i]) * dv
        if w.limit_on[i, 0] and w.limit_v[i, 0] - v > 0.0:
            first -= limit_impulse(w, i, 0, v) * dv
            second += dv * dv / w.limit_R[i]
        if w.limit_on[i, 1] and w.limit_v[i, 1] + v > 0.0:
            first += limit_impulse(w, i, 1, -v) * dv
            second += dv * dv / w.limit_R[i]
    for c in range(count):
        a, b, e = w.dvc[c, 0], w.dvc[c, 1], w.dvc[c, 2]
        x, y = w.vc[c, 0] + alpha * a, w.vc[c, 1] + alpha * b
        size = x * x + y * y + w.soft[c] * w.soft[c]
        per_speed = w.friction[c] * w.normal[c] / math.sqrt(size)
        normal, slope = normal_impulse(w, c, w.vc[c, 2] + alpha * e, dt)
        first += per_speed * (x * a + y * b) - normal * e
        second += per_speed * (a * a + b * b - (x * a + y * b) ** 2 / size) + slope * e * e
    return first, second


@part
def step_length(tree: Tree, dt: float, count: int, curve: float, cost: float, w: Work) -> float:
    """Where the cost is least along dv: Newton on its slope, by halves where that is slow (as rtsafe, Press et al. 2007,
    section 9.4). cost: where it begins."""
    falls = 0.0
    for k in range(tree.path.shape[0]):
        falls -= w.gradient[k] * w.dv[k]
    slope, curvature = _slope(tree, dt, count, LONGEST_STEP, curve, w)
    if slope <= 0.0:
        return LONGEST_STEP
    most = abs(cost) + LONGEST_STEP * slope  # of the cost at the longest step, which is convex
    if (falls < 2.0 * (COST_ABSOLUTE + COST_RELATIVE * most)
            and falls < COST_ABSOLUTE + COST_RELATIVE * cost_along(tree, dt, count, LONGEST_STEP, w)):
        return 1.0
    if slope / falls < LINE_TOLERANCE:
        return LONGEST_STEP
    guess = min(falls / curvature, LONGEST_STEP)
    low, high, at = 0.0, LONGEST_STEP, guess
    change = before = low - high
    for _ in range(MOST_ITERATIONS):
        slope, curvature = _slope(tree, dt, count, at, curve, w)
        slope, curvature = slope / falls, curvature / falls
        if slope < 0.0:
            low = at
        else:
            high = at
        if abs(slope) < LINE_TOLERANCE:
            return at
        slow = 2.0 * abs(slope) > abs(before * curvature)
        before = change
        change = slope / curvature
        if slow or not low <= at - change <= high:
            change = 0.5 * (low - high)
            at = low - change
        else:
            at -= change
        if abs(change) < LINE_TOLERANCE * guess:
            return at
    return at
