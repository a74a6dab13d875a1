"""The watch of several robots at once that no links touch; a lane in which any do is left to the kernel of one robot."""

from __future__ import annotations

from typing import Any, NamedTuple

from workbench.simulation.compiled.arrays import Shapes
from workbench.simulation.compiled.kernel import part, rare
from workbench.simulation.compiled.lanes.arrays import Room
from workbench.simulation.compiled.links import outside, shapes_touch
from workbench.simulation.compiled.number import LANES, Mask, Wide, anywhere, lane, where, wide, with_lane
from workbench.simulation.compiled.vectors import turned
from workbench.types import Array


class Poses(NamedTuple):
    """R (n+1, 3, 3): of bodies of one lane."""

    R: Array


@part
def touching(shapes: Shapes, gone: Mask, w: Room) -> Mask:
    """gone, with the lanes in which shapes of two links touch; as early as `link_contacts` takes notice."""
    for c in range(shapes.bodies.shape[0]):
        b = shapes.bodies[c]
        x, y, z = turned(w.R[b], shapes.middle[c, 0], shapes.middle[c, 1], shapes.middle[c, 2])
        w.F[c, 0], w.F[c, 1], w.F[c, 2] = x + w.p[b, 0], y + w.p[b, 1], z + w.p[b, 2]  # room that this step needs no more
    for k in range(shapes.near.shape[0]):
        a, c = shapes.near[k, 0], shapes.near[k, 1]
        x, y, z = w.F[a, 0] - w.F[c, 0], w.F[a, 1] - w.F[c, 1], w.F[a, 2] - w.F[c, 2]
        apart = shapes.reach[a] + shapes.reach[c]
        if anywhere((x * x + y * y + z * z < apart * apart) & ~gone):
            gone = _bodies_touch(shapes, shapes.bodies[a], shapes.bodies[c], gone, w)
    return gone


@part
def _bodies_touch(shapes: Shapes, a: int, b: int, gone: Mask, w: Room) -> Mask:
    for s in range(shapes.body.shape[0]):
        if shapes.body[s] != a:
            continue
        sx, sy, sz = turned(w.R[a], shapes.p[s, 0], shapes.p[s, 1], shapes.p[s, 2])
        for t in range(shapes.body.shape[0]):
            if shapes.body[t] != b or not shapes.may_touch[s, t]:
                continue
            tx, ty, tz = turned(w.R[b], shapes.p[t, 0], shapes.p[t, 1], shapes.p[t, 2])
            x, y, z = sx + w.p[a, 0] - (tx + w.p[b, 0]), sy + w.p[a, 1] - (ty + w.p[b, 1]), sz + w.p[a, 2] - (tz + w.p[b, 2])
            apart = shapes.size[s] + shapes.size[t]
            near = x * x + y * y + z * z < apart * apart
            if anywhere(near & ~gone):
                gone = _which_touch(shapes, s, t, x, y, z, near, gone, w)
    return gone


@part
def _which_touch(shapes: Shapes, s: int, t: int, x: Wide, y: Wide, z: Wide, near: Mask, gone: Mask, w: Room) -> Mask:
    at = where(near & ~gone, 1.0, 0.0)
    for i in range(LANES):
        if lane(at, i) > 0.0:
            for b in (shapes.body[s], shapes.body[t]):
                for r in range(3):
                    for c in range(3):
                        w.lane_R[b, r, c] = lane(w.R[b, r, c], i)
            if not _touch(shapes, s, t, lane(x, i), lane(y, i), lane(z, i), Poses(w.lane_R)):
                at = with_lane(at, i, 0.0)
    return gone | (at > wide(0.0))


@rare
def _touch(shapes: Shapes, s: int, t: int, x: float, y: float, z: float, poses: Any) -> bool:
    """Whether two shapes of one robot, whose middles are (x, y, z) apart, touch."""
    if shapes.pair[s, t] >= 0:
        return outside(shapes, t, x, y, z, poses)[0] < shapes.radius[s]
    if shapes.pair[t, s] >= 0:
        return outside(shapes, s, -x, -y, -z, poses)[0] < shapes.radius[t]
    return shapes_touch(shapes, s, t, x, y, z, poses)
