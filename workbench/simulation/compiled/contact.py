"""Spheres on a level floor, and the watch that nothing else touches.

Points, stiffness in series and Jacobians as Drake's point contact has them (Masterjohn et al. 2022, section III; Drake's
documentation, "Point Contact in Drake").
"""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import Array, Shapes, State, Tree, Work
from workbench.simulation.compiled.kernel import part
from workbench.simulation.compiled.vectors import cross, turned


@part
def _height(shapes: Shapes, s: int, w: Work) -> float:
    """Of the middle of a shape, from the root's origin."""
    b = shapes.body[s]
    return w.p[b, 2] + w.R[b, 2, 0] * shapes.p[s, 0] + w.R[b, 2, 1] * shapes.p[s, 1] + w.R[b, 2, 2] * shapes.p[s, 2]


@part
def find_contacts(tree: Tree, shapes: Shapes, state: State, dt: float, w: Work) -> int:
    """How many spheres touch the floor: number c is of shape w.shape[c], with Jacobian w.J[c] of its point's velocity, elastic
    force w.elastic[c] and last step's normal impulse w.normal[c] as friction takes it."""
    n = tree.parent.shape[0]
    count = 0
    for s in range(shapes.body.shape[0]):
        if shapes.radius[s] <= 0.0:
            continue
        b = shapes.body[s]
        z = _height(shapes, s, w) + state.base[6]
        depth = shapes.radius[s] - z
        if depth <= 0.0:
            continue
        x, y, _ = turned(w.R[b], shapes.p[s, 0], shapes.p[s, 1], shapes.p[s, 2])
        w.shape[count] = s
        last = 6 + b if b < n else 5
        _point_jacobian(tree, last, x + w.p[b, 0], y + w.p[b, 1], -depth * shapes.depth[s] - state.base[6], w.J[count], w)
        for r in range(3):
            w.vc[count, r] = along_path(tree, last, w.J[count, r], state.v)
        w.elastic[count] = shapes.stiffness[s] * depth
        w.normal[count] = dt * w.elastic[count] * max(0.0, 1.0 - shapes.dissipation[s] * w.vc[count, 2])
        count += 1
    return count


@part
def _point_jacobian(tree: Tree, last: int, x: float, y: float, z: float, J: Array, w: Work) -> None:
    """J (3, nv) of the velocity of a point (x, y, z from the base's origin) of the body that velocity `last` moves."""
    for r in range(3):
        for k in range(6):
            J[r, k] = 0.0
        J[r, 3 + r] = 1.0
    J[0, 1], J[0, 2], J[1, 0], J[1, 2], J[2, 0], J[2, 1] = z, -y, -z, x, y, -x
    j = last
    while j >= 6:
        cx, cy, cz = cross(w.S[j, 0], w.S[j, 1], w.S[j, 2], x, y, z)
        J[0, j], J[1, j], J[2, j] = w.S[j, 3] + cx, w.S[j, 4] + cy, w.S[j, 5] + cz
        j = tree.path[j]


@part
def along_path(tree: Tree, last: int, row: Array, x: Array) -> float:
    """Product of a Jacobian's row and x, of the velocities from `last` to the root."""
    total = 0.0
    j = last
    while j >= 0:
        total += row[j] * x[j]
        j = tree.path[j]
    return total


@part
def lowest(tree: Tree, shapes: Shapes, boxes: bool, w: Work) -> float:
    """Lowest z of the shapes from the root's origin [m]; boxes: of their boxes, spheres' too."""
    low = math.inf
    for s in range(shapes.body.shape[0]):
        b = shapes.body[s]
        z = _height(shapes, s, w)
        reach = shapes.radius[s]
        if boxes or reach <= 0.0:
            reach = _box_reach(w.R[b, 2], shapes.R[s], shapes.half[s])
        low = min(low, z - reach)
    return low if low < math.inf else 0.0


@part
def _box_reach(up: Array, R: Array, half: Array) -> float:
    """How far a box (axes R, half its sides) goes along the direction `up` (3,), both in the body's frame."""
    reach = 0.0
    for k in range(3):
        reach += abs(up[0] * R[0, k] + up[1] * R[1, k] + up[2] * R[2, k]) * half[k]
    return reach


@part
def touches_otherwise(tree: Tree, shapes: Shapes, state: State, w: Work) -> bool:
    """Whether something may touch that this station does not know: shapes of two links, or the floor by another shape than a
    sphere. May say so a little too early; never too late."""
    for c in range(shapes.bodies.shape[0]):
        b = shapes.bodies[c]
        x, y, z = turned(w.R[b], shapes.middle[c, 0], shapes.middle[c, 1], shapes.middle[c, 2])
        w.F[c, 0], w.F[c, 1], w.F[c, 2] = x + w.p[b, 0], y + w.p[b, 1], z + w.p[b, 2]  # room that this step needs no more
        if tree.free and w.F[c, 2] + state.base[6] < shapes.reach[c] and _box_on_floor(shapes, b, state.base[6], w):
            return True
    for k in range(shapes.near.shape[0]):
        a, c = shapes.near[k, 0], shapes.near[k, 1]
        x, y, z = w.F[a, 0] - w.F[c, 0], w.F[a, 1] - w.F[c, 1], w.F[a, 2] - w.F[c, 2]
        apart = shapes.reach[a] + shapes.reach[c]
        if x * x + y * y + z * z < apart * apart and _bodies_touch(shapes, shapes.bodies[a], shapes.bodies[c], w):
            return True
    return False


@part
def _box_on_floor(shapes: Shapes, b: int, height: float, w: Work) -> bool:
    for s in range(shapes.body.shape[0]):
        if shapes.body[s] == b and shapes.radius[s] <= 0.0:
            z = height + _height(shapes, s, w)
            if z < _box_reach(w.R[b, 2], shapes.R[s], shapes.half[s]):
                return True
    return False


@part
def _bodies_touch(shapes: Shapes, a: int, b: int, w: Work) -> bool:
    for s in range(shapes.body.shape[0]):
        if shapes.body[s] != a:
            continue
        for t in range(shapes.body.shape[0]):
            if shapes.body[t] == b and shapes.may_touch[s, t] and _shapes_touch(shapes, s, t, w):
                return True
    return False


@part
def _shapes_touch(shapes: Shapes, s: int, t: int, w: Work) -> bool:
    a, b = shapes.body[s], shapes.body[t]
    x, y, z = turned(w.R[a], shapes.p[s, 0], shapes.p[s, 1], shapes.p[s, 2])
    u, v, q = turned(w.R[b], shapes.p[t, 0], shapes.p[t, 1], shapes.p[t, 2])
    x, y, z = x + w.p[a, 0] - u - w.p[b, 0], y + w.p[a, 1] - v - w.p[b, 1], z + w.p[a, 2] - q - w.p[b, 2]
    if shapes.radius[s] > 0.0 and shapes.radius[t] > 0.0:
        apart = shapes.radius[s] + shapes.radius[t]
        return x * x + y * y + z * z < apart * apart
    if shapes.radius[s] > 0.0:
        return _ball_in_box(shapes, t, x, y, z, shapes.radius[s], w)
    if shapes.radius[t] > 0.0:
        return _ball_in_box(shapes, s, -x, -y, -z, shapes.radius[t], w)
    return _boxes_touch(shapes, s, t, x, y, z, w)


@part
def _box_axis(shapes: Shapes, s: int, k: int, w: Work) -> tuple[float, float, float]:
    """Axis k of a shape's box, in W."""
    return turned(w.R[shapes.body[s]], shapes.R[s, 0, k], shapes.R[s, 1, k], shapes.R[s, 2, k])


@part
def _ball_in_box(shapes: Shapes, t: int, x: float, y: float, z: float, radius: float, w: Work) -> bool:
    """Whether a ball at (x, y, z) from the middle of box t reaches into it."""
    beyond = 0.0
    for k in range(3):
        ax, ay, az = _box_axis(shapes, t, k, w)
        past = max(abs(x * ax + y * ay + z * az) - shapes.half[t, k], 0.0)
        beyond += past * past
    return beyond < radius * radius


@part
def _boxes_touch(shapes: Shapes, s: int, t: int, x: float, y: float, z: float, w: Work) -> bool:
    """Separating axes of two boxes whose middles are (x, y, z) apart (Gottschalk et al. 1996); of edges' axes too."""
    for k in range(3):
        ax, ay, az = _box_axis(shapes, s, k, w)
        if _separates(shapes, s, t, ax, ay, az, x, y, z, w):
            return False
        ax, ay, az = _box_axis(shapes, t, k, w)
        if _separates(shapes, s, t, ax, ay, az, x, y, z, w):
            return False
    for k in range(3):
        for m in range(3):
            ax, ay, az = _box_axis(shapes, s, k, w)
            bx, by, bz = _box_axis(shapes, t, m, w)
            cx, cy, cz = cross(ax, ay, az, bx, by, bz)
            if cx * cx + cy * cy + cz * cz > 1e-12 and _separates(shapes, s, t, cx, cy, cz, x, y, z, w):
                return False
    return True


@part
def _separates(shapes: Shapes, s: int, t: int, ax: float, ay: float, az: float, x: float, y: float, z: float, w: Work) -> bool:
    reach = 0.0
    for k in range(3):
        bx, by, bz = _box_axis(shapes, s, k, w)
        reach += abs(ax * bx + ay * by + az * bz) * shapes.half[s, k]
        bx, by, bz = _box_axis(shapes, t, k, w)
        reach += abs(ax * bx + ay * by + az * bz) * shapes.half[t, k]
    return abs(ax * x + ay * y + az * z) > reach
