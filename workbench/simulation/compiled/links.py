"""Contacts of spheres with boxes, cylinders and spheres of other links, and the watch that nothing else touches.

Normals, depths and points as Drake's point contact has them where the sphere's middle is outside the other (its penetration query
`SphereShapePenetration`): from the nearest point N of the other to the sphere's middle, radius less that distance.
"""

from __future__ import annotations

import math

from workbench.simulation.compiled.arrays import CYLINDER, Shapes, State, Tree, Work
from workbench.simulation.compiled.contact import box_reach, deepest, load_contact, shape_height
from workbench.simulation.compiled.kernel import part, rare
from workbench.simulation.compiled.vectors import Four, Three, clamp, cross, turned

UNKNOWN = -1
"""For a number of contacts: something touches that this station does not know."""
ON_SURFACE = 1e-9
"""[m]: a sphere's middle that is no farther outside, or within, is Drake's."""


@part
def link_contacts(tree: Tree, shapes: Shapes, state: State, dt: float, count: int, w: Work) -> int:
    """Adds the contacts between links to `count` of the floor; UNKNOWN where a contact is possible that this station does not
    support: other shapes of two links, or the floor by another shape than a sphere. May return it a little too early; never too
    late."""
    w.crossed[0] = False
    for c in range(shapes.bodies.shape[0]):
        b = shapes.bodies[c]
        x, y, z = turned(w.R[b], shapes.middle[c, 0], shapes.middle[c, 1], shapes.middle[c, 2])
        w.F[c, 0], w.F[c, 1], w.F[c, 2] = x + w.p[b, 0], y + w.p[b, 1], z + w.p[b, 2]  # room that this step needs no more
        if tree.free and w.F[c, 2] + state.base[6] < shapes.reach[c] and _box_on_floor(shapes, b, state.base[6], w):
            return UNKNOWN
    for k in range(shapes.near.shape[0]):
        a, c = shapes.near[k, 0], shapes.near[k, 1]
        x, y, z = w.F[a, 0] - w.F[c, 0], w.F[a, 1] - w.F[c, 1], w.F[a, 2] - w.F[c, 2]
        apart = shapes.reach[a] + shapes.reach[c]
        if x * x + y * y + z * z < apart * apart:
            count = _body_contacts(tree, shapes, state, dt, shapes.bodies[a], shapes.bodies[c], count, w)
            if count == UNKNOWN:
                return UNKNOWN
    return count


@part
def _box_on_floor(shapes: Shapes, b: int, height: float, w: Work) -> bool:
    for s in range(shapes.body.shape[0]):
        if shapes.body[s] == b and shapes.radius[s] <= 0.0:
            z = height + shape_height(shapes, s, w)
            if z < box_reach(w.R[b, 2], shapes.R[s], shapes.half[s]):
                return True
    return False


@part
def _body_contacts(tree: Tree, shapes: Shapes, state: State, dt: float, a: int, b: int, count: int, w: Work) -> int:
    for s in range(shapes.body.shape[0]):
        if shapes.body[s] != a:
            continue
        sx, sy, sz = _middle(shapes, s, w)
        for t in range(shapes.body.shape[0]):
            if shapes.body[t] != b or not shapes.may_touch[s, t]:
                continue
            tx, ty, tz = _middle(shapes, t, w)
            x, y, z = sx - tx, sy - ty, sz - tz
            apart = shapes.size[s] + shapes.size[t]
            if x * x + y * y + z * z >= apart * apart:
                continue
            if shapes.pair[s, t] >= 0:
                count = _add_contact(tree, shapes, state, dt, s, t, sx, sy, sz, x, y, z, count, w)
            elif shapes.pair[t, s] >= 0:
                count = _add_contact(tree, shapes, state, dt, t, s, tx, ty, tz, -x, -y, -z, count, w)
            elif shapes_touch(shapes, s, t, x, y, z, w):
                return UNKNOWN
            if count == UNKNOWN:
                return UNKNOWN
    return count


@part
def _middle(shapes: Shapes, s: int, w: Work) -> Three:
    """Of a shape, from the root's origin."""
    b = shapes.body[s]
    x, y, z = turned(w.R[b], shapes.p[s, 0], shapes.p[s, 1], shapes.p[s, 2])
    return x + w.p[b, 0], y + w.p[b, 1], z + w.p[b, 2]


@rare
def _add_contact(tree: Tree, shapes: Shapes, state: State, dt: float, ball: int, other: int, x: float, y: float, z: float,
                 dx: float, dy: float, dz: float, count: int, w: Work) -> int:
    """Contact number `count`, if the ball whose middle is at (x, y, z), and (dx, dy, dz) from the other's, touches the other."""
    n, o = tree.parent.shape[0], 6 if tree.free else 0
    a, b = shapes.body[ball], shapes.body[other]
    distance, nx, ny, nz = outside(shapes, other, dx, dy, dz, w)
    depth = shapes.radius[ball] - distance
    if depth <= 0.0:
        return count
    if distance <= ON_SURFACE or count == w.shape.shape[0]:
        return UNKNOWN
    k = shapes.pair[ball, other]
    w.shape[count] = -1
    w.stiffness[count], w.dissipation[count], w.friction[count] = shapes.pairs[k, 0], shapes.pairs[k, 1], shapes.pairs[k, 2]
    back = distance + shapes.pairs[k, 3] * depth  # from the ball's middle to the point, against the normal
    _write_branches(tree, count, o + a if a < n else o - 1, o + b if b < n else o - 1, w)
    _write_frame(count, nx, ny, nz, w)
    for r in range(3):
        for t in range(deepest(tree, count, w) + 1):
            w.J[count, r, t] = 0.0
    _add_velocities(tree, count, o + a if a < n else o - 1, 1.0, x - back * nx, y - back * ny, z - back * nz, w)
    _add_velocities(tree, count, o + b if b < n else o - 1, -1.0, x - back * nx, y - back * ny, z - back * nz, w)
    load_contact(tree, state, dt, count, depth, w)
    return count + 1


@part
def _write_branches(tree: Tree, c: int, a: int, b: int, w: Work) -> None:
    """w.last and w.other of the contact of two bodies that velocities a and b move, -1 for a body that nothing moves."""
    low, high = min(a, b), max(a, b)
    j = high
    while j > low:
        j = tree.path[j]
    w.last[c] = high
    w.other[c] = -1 if j == low else low
    if j != low:
        w.crossed[0] = True


@part
def _write_frame(c: int, x: float, y: float, z: float, w: Work) -> None:
    """Axes of a contact, the last along its normal (x, y, z); rows of w.frame."""
    ux, uy, uz = (0.0, z, -y) if abs(x) < 0.6 else (-z, 0.0, x)  # a coordinate's axis that is not near, times the normal
    size = math.sqrt(ux * ux + uy * uy + uz * uz)
    ux, uy, uz = ux / size, uy / size, uz / size
    vx, vy, vz = cross(x, y, z, ux, uy, uz)
    w.frame[0, 0], w.frame[0, 1], w.frame[0, 2] = ux, uy, uz
    w.frame[1, 0], w.frame[1, 1], w.frame[1, 2] = vx, vy, vz
    w.frame[2, 0], w.frame[2, 1], w.frame[2, 2] = x, y, z


@part
def _add_velocities(tree: Tree, c: int, last: int, sign: float, x: float, y: float, z: float, w: Work) -> None:
    """Adds the velocity of a body's point (x, y, z from the root's origin), times a sign, to a contact's Jacobian."""
    j = last
    while j >= 0:
        cx, cy, cz = cross(w.S[j, 0], w.S[j, 1], w.S[j, 2], x, y, z)
        cx, cy, cz = turned(w.frame, sign * (w.S[j, 3] + cx), sign * (w.S[j, 4] + cy), sign * (w.S[j, 5] + cz))
        t = j if w.other[c] >= 0 else tree.depth[j]
        w.J[c, 0, t] += cx
        w.J[c, 1, t] += cy
        w.J[c, 2, t] += cz
        j = tree.path[j]


@part
def outside(shapes: Shapes, t: int, x: float, y: float, z: float, w: Work) -> Four:
    """How far outside shape t, a ball, a box or a cylinder, the point is that is (x, y, z) from its middle, and the direction
    away from the nearest point, in W; not positive within."""
    if shapes.radius[t] > 0.0:
        size = math.sqrt(x * x + y * y + z * z)
        return size - shapes.radius[t], x / size, y / size, z / size
    ax, ay, az = _box_axis(shapes, t, 0, w)
    bx, by, bz = _box_axis(shapes, t, 1, w)
    cx, cy, cz = _box_axis(shapes, t, 2, w)
    u, v, q = x * ax + y * ay + z * az, x * bx + y * by + z * bz, x * cx + y * cy + z * cz
    q = _past(q, shapes.half[t, 2])
    if shapes.solid[t] == CYLINDER:
        radial = math.sqrt(u * u + v * v)
        share = max(radial - shapes.half[t, 0], 0.0) / radial if radial > 0.0 else 0.0
        u, v = share * u, share * v
    else:
        u, v = _past(u, shapes.half[t, 0]), _past(v, shapes.half[t, 1])
    size = math.sqrt(u * u + v * v + q * q)
    u, v, q = u / size, v / size, q / size
    return size, u * ax + v * bx + q * cx, u * ay + v * by + q * cy, u * az + v * bz + q * cz


@part
def _past(x: float, half: float) -> float:
    """What x is beyond the ends -half and half."""
    return x - clamp(x, -half, half)


@part
def shapes_touch(shapes: Shapes, s: int, t: int, x: float, y: float, z: float, w: Work) -> bool:
    """Whether shapes whose middles are (x, y, z) apart may touch; spheres, else their boxes."""
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
