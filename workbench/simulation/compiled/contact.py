"""Spheres on a level floor.

Points, stiffness in series and Jacobians as Drake's point contact has them (Masterjohn et al. 2022, section III; Drake's
documentation, "Point Contact in Drake").
"""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import Array, Shapes, State, Tree, Work
from workbench.simulation.compiled.kernel import part
from workbench.simulation.compiled.vectors import Three, cross, turned


@part
def shape_height(shapes: Shapes, s: int, w: Work) -> float:
    """Of the middle of a shape, from the root's origin."""
    b = shapes.body[s]
    return w.p[b, 2] + w.R[b, 2, 0] * shapes.p[s, 0] + w.R[b, 2, 1] * shapes.p[s, 1] + w.R[b, 2, 2] * shapes.p[s, 2]


@part
def floor_contacts(tree: Tree, shapes: Shapes, state: State, dt: float, w: Work) -> int:
    """How many spheres touch the floor: number c is of shape w.shape[c], with Jacobian w.J[c] of its point's velocity, elastic
    force w.elastic[c] and last step's normal impulse w.normal[c] as friction takes it."""
    n = tree.parent.shape[0]
    count = 0
    for s in range(shapes.body.shape[0]):
        if shapes.radius[s] <= 0.0:
            continue
        b = shapes.body[s]
        z = shape_height(shapes, s, w) + state.base[6]
        depth = shapes.radius[s] - z
        if depth <= 0.0:
            continue
        x, y, _ = turned(w.R[b], shapes.p[s, 0], shapes.p[s, 1], shapes.p[s, 2])
        last = 6 + b if b < n else 5
        w.shape[count], w.last[count], w.other[count] = s, last, -1
        w.stiffness[count], w.dissipation[count] = shapes.stiffness[s], shapes.dissipation[s]
        w.friction[count] = shapes.friction[s]
        _point_jacobian(tree, last, x + w.p[b, 0], y + w.p[b, 1], -depth * shapes.depth[s] - state.base[6], w.J[count], w)
        load_contact(tree, state, dt, count, depth, w)
        count += 1
    return count


@part
def load_contact(tree: Tree, state: State, dt: float, c: int, depth: float, w: Work) -> None:
    """Velocity, elastic force and last step's normal impulse of a contact whose Jacobian and numbers are there."""
    w.vc[c, 0], w.vc[c, 1], w.vc[c, 2] = along(tree, c, state.v, w)
    w.elastic[c] = w.stiffness[c] * depth
    w.normal[c] = dt * w.elastic[c] * max(0.0, 1.0 - w.dissipation[c] * w.vc[c, 2])


@part
def _point_jacobian(tree: Tree, last: int, x: float, y: float, z: float, J: Array, w: Work) -> None:
    """J (3, nv) of the velocity of a point (x, y, z from the base's origin) of the body that velocity `last` moves."""
    for r in range(3):
        for k in range(6):
            J[r, k] = 0.0
        J[r, 3 + r] = 1.0
    J[0, 1], J[0, 2], J[1, 0], J[1, 2], J[2, 0], J[2, 1] = z, -y, -z, x, y, -x
    for t in range(6, tree.depth[last] + 1):
        j = tree.above[last, t]
        cx, cy, cz = cross(w.S[j, 0], w.S[j, 1], w.S[j, 2], x, y, z)
        J[0, t], J[1, t], J[2, t] = w.S[j, 3] + cx, w.S[j, 4] + cy, w.S[j, 5] + cz


@part
def deepest(tree: Tree, c: int, w: Work) -> int:
    """The last column of contact c's Jacobian."""
    return w.last[c] if w.other[c] >= 0 else tree.depth[w.last[c]]


@part
def along(tree: Tree, c: int, x: Array, w: Work) -> Three:
    """Product of contact c's Jacobian and x, of all velocities."""
    of = tree.number if w.other[c] >= 0 else tree.above[w.last[c]]
    a = b = d = 0.0
    for t in range(deepest(tree, c, w), -1, -1):
        v = x[of[t]]
        a += w.J[c, 0, t] * v
        b += w.J[c, 1, t] * v
        d += w.J[c, 2, t] * v
    return a, b, d


@part
def lowest(tree: Tree, shapes: Shapes, boxes: bool, w: Work) -> float:
    """Lowest z of the shapes from the root's origin [m]; boxes: of their boxes, spheres' too."""
    low = math.inf
    for s in range(shapes.body.shape[0]):
        b = shapes.body[s]
        z = shape_height(shapes, s, w)
        reach = shapes.radius[s]
        if boxes or reach <= 0.0:
            reach = box_reach(w.R[b, 2], shapes.R[s], shapes.half[s])
        low = min(low, z - reach)
    return low if low < math.inf else 0.0


@part
def box_reach(up: Array, R: Array, half: Array) -> float:
    """How far a box (axes R, half its sides) goes along the direction `up` (3,), both in the body's frame."""
    reach = 0.0
    for k in range(3):
        reach += abs(up[0] * R[0, k] + up[1] * R[1, k] + up[2] * R[2, k]) * half[k]
    return reach
