"""Shapes of the puppy's parts, drawn by hand from their outer sizes (data/parts.csv); no mesh of anyone else's.

A shape is a list of convex solids with colours. `solid` ones carry the part's mass, evenly by volume; the others
(screws, labels, lamps) are only to look at. Metres; each function says where its frame lies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import trimesh

BLACK, DARK, GREY, FRAME, WHITE = (24, 24, 26), (44, 45, 48), (92, 94, 98), (196, 199, 203), (236, 236, 232)
RED, GREEN, BLUE, ORANGE, RUBBER = (200, 40, 36), (60, 170, 80), (36, 62, 130), (232, 120, 30), (30, 30, 32)
MM = 1e-3


@dataclass(frozen=True)
class Solid:
    """One convex piece: its mesh, its colour (RGB), and whether it carries mass."""

    mesh: trimesh.Trimesh
    colour: tuple[int, int, int]
    massive: bool = True


Shape = list[Solid]


def hull(points: Iterable[Iterable[float]]) -> trimesh.Trimesh:
    """Convex hull of points given in millimetres."""
    return trimesh.convex.convex_hull(np.asarray(list(points), dtype=float) * MM)


def box(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], chamfer: float = 0.0) -> trimesh.Trimesh:
    """Box between limits [mm], its edges along z cut by `chamfer`."""
    c = chamfer
    corners = [(x[0], y[0] + c), (x[0] + c, y[0]), (x[1] - c, y[0]), (x[1], y[0] + c),
               (x[1], y[1] - c), (x[1] - c, y[1]), (x[0] + c, y[1]), (x[0], y[1] - c)]
    return hull([(*p, h) for p in corners for h in z])


def disc(radius: float, z: tuple[float, float], at: tuple[float, float] = (0.0, 0.0), sides: int = 20) -> trimesh.Trimesh:
    """Cylinder along z between limits [mm]."""
    angle = np.linspace(0, 2 * np.pi, sides, endpoint=False)
    return hull([(at[0] + radius * np.cos(a), at[1] + radius * np.sin(a), h) for a in angle for h in z])


def screws(radius: float, circle: float, z: tuple[float, float]) -> Shape:
    """Heads of four screws on a circle about z [mm], to look at."""
    at = [(circle * np.cos(a), circle * np.sin(a)) for a in np.deg2rad([45, 135, 225, 315])]
    return [Solid(disc(radius, z, p, sides=6), BLACK, False) for p in at]


def ax12a() -> Shape:
    """AX-12A: z along its axis out of the horn, origin on the axis in mid-body, body towards -y (CAD: x +-16, y -38.5 to 11.5,
    z -19 to 21.9)."""
    def prism(w: float, low: float, high: float, top: float, z: tuple[float, float]) -> trimesh.Trimesh:
        outline = [(-w + 2, low), (w - 2, low), (w, low + 2), (w, 2), (top, high), (-top, high), (-w, 2), (-w, low + 2)]
        return hull([(*p, h) for p in outline for h in z])

    pieces = [
        Solid(prism(16, -38.5, 11.5, 7.5, (-12.5, 12.5)), DARK),
        Solid(prism(14.5, -37, 10.5, 6.5, (12.5, 17)), BLACK),
        Solid(prism(14.5, -37, 10.5, 6.5, (-19, -12.5)), BLACK),
        Solid(disc(11, (17, 21.9)), GREY),
        Solid(disc(3.2, (21.9, 22.2), sides=10), BLACK, False),
        Solid(disc(8, (-21, -19), sides=12), GREY, False),
        Solid(box((-9, 9), (-33, -18), (17, 17.3)), GREY, False),
        Solid(box((-7, 7), (-31.5, -26), (17.3, 17.5)), WHITE, False),
        Solid(box((-12, -4), (-36, -29), (-19.6, -19)), WHITE, False),
        Solid(box((4, 12), (-36, -29), (-19.6, -19)), WHITE, False),
        Solid(box((-1.5, 1.5), (-16, -14.5), (17, 17.4)), RED, False),
    ]
    pieces += screws(1.4, 8, (21.9, 22.3))
    for x in (-16.3, 15.8):
        pieces += [Solid(box((x, x + 0.5), (y - 2, y + 2), (-9, 9)), GREY, False) for y in (-34, -22, -10)]
    return pieces


def bracket(base: float, half_width: float, plate: tuple[float, float]) -> Shape:
    """U-bracket on a servo's horn and idler: z along the servo's axis, base plate at y = -`base` (outer face), which spans
    `plate` in x; arms 2 mm thick at z = +-23 (CAD of FP04-F1, F2)."""
    pieces = [Solid(box(plate, (-base, 2 - base), (-21, 21)), FRAME)]
    for side in (-1, 1):
        z = (21.0, 23.0) if side > 0 else (-23.0, -21.0)
        ring = [(half_width * np.cos(a), half_width * np.sin(a)) for a in np.linspace(0, np.pi, 9)]
        outline = [*ring, (-half_width, -base + 3), (-half_width + 3, -base), (half_width - 3, -base), (half_width, -base + 3)]
        pieces.append(Solid(hull([(*p, h) for p in outline for h in z]), FRAME))
        outer = (23.0, 24.4) if side > 0 else (-24.4, -23.0)
        pieces.append(Solid(disc(3, outer, sides=10), GREY, False))
        pieces += screws(1.3, 7.5, outer)
        pieces.append(Solid(box((-5.5, 5.5), (-base + 5, -13), (23.0, 23.15) if side > 0 else (-23.15, -23.0)), GREY, False))
    return pieces


def f1() -> Shape:
    """FP04-F1: see `bracket`; its base reaches to x = 27, where the horn of the joint above sits (CAD)."""
    return [*bracket(23, 11, (-11, 27)), Solid(_along_y(disc(9, (-23.8, -23), sides=14), 14.5), GREY, False)]


def f2() -> Shape:
    """FP04-F2: see `bracket` (CAD)."""
    return bracket(26, 12.5, (-12.5, 12.5))


def _along_y(mesh: trimesh.Trimesh, x: float) -> trimesh.Trimesh:
    """A mesh drawn along z, turned to lie along y, moved to x [mm]."""
    return moved(mesh, [[1, 0, 0, x * MM], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def moved(mesh: trimesh.Trimesh, transform: Iterable[Iterable[float]]) -> trimesh.Trimesh:
    """A copy under a homogeneous transform."""
    return mesh.copy().apply_transform(np.asarray(transform, dtype=float))


def f3() -> Shape:
    """FP04-F3: a shallow U, 38 x 25 x 9 mm, plate in the plane z = 0, walls towards +z, long side along x."""
    return [
        Solid(box((-19, 19), (-12.5, 12.5), (0, 2), 2), FRAME),
        Solid(box((-19, -17), (-12.5, 12.5), (2, 9), 0.5), FRAME),
        Solid(box((17, 19), (-12.5, 12.5), (2, 9), 0.5), FRAME),
    ]


def cm530() -> Shape:
    """CM-530, 101 x 69 x 32 mm: long side along x, buttons up, origin in the middle of the box."""
    pieces = [
        Solid(box((-50.5, 50.5), (-34.5, 34.5), (-16, 10), 5), DARK),
        Solid(box((-48.5, 48.5), (-32.5, 32.5), (10, 16), 6), GREY),
        Solid(box((-44, 14), (-25, 25), (16, 16.4), 3), BLACK, False),
        Solid(box((-38, 6), (14, 21), (16.4, 16.6)), BLUE, False),
        Solid(box((18, 44), (-26, -14), (16, 18.5), 1), RED, False),
        Solid(box((24, 38), (-24, -16), (18.5, 20), 1), BLACK, False),
    ]
    pad = {(-20.0, 4.0): GREY, (-20.0, -16.0): GREY, (-30.0, -6.0): GREY, (-10.0, -6.0): GREY}
    pieces += [Solid(disc(4, (16.4, 18.6), at, sides=12), c, False) for at, c in pad.items()]
    pieces += [Solid(disc(5, (16, 18.6), (32, y), sides=14), c, False) for y, c in ((4, ORANGE), (20, BLUE))]
    lamps = (RED, GREEN, GREEN, ORANGE, BLUE)
    pieces += [Solid(box((x, x + 3), (-32, -29), (16, 16.6)), c, False) for x, c in zip(range(-40, 10, 9), lamps)]
    pieces += [Solid(box((x, x + 8), (y, y + 0.6), (-6, 2)), BLACK, False) for x in (-40, -26, -12, 2, 16) for y in (-35, 34.4)]
    return pieces


def block(size: Iterable[float], colour: tuple[int, int, int], chamfer: float = 1.5) -> Shape:
    """Box of outer size [mm] about its origin."""
    x, y, z = size
    return [Solid(box((-x / 2, x / 2), (-y / 2, y / 2), (-z / 2, z / 2), min(chamfer, min(x, y) / 4)), colour)]


def lbs10() -> Shape:
    """LBS-10, 88 x 36 x 20 mm about its origin, long side along x, with its label and lead."""
    return [*block((88, 36, 20), BLACK, 4), Solid(box((-30, 30), (-18.2, 18.2), (-6, 6)), BLUE, False),
            Solid(box((-52, -44), (4, 10), (-3, 3)), RED, False)]


def head_shell() -> Shape:
    """Face, ears and infrared eyes of the head: origin on the head's axis, x out of the snout, z up."""
    pieces = [
        Solid(box((39, 43), (-17, 17), (-15, 15), 3), FRAME),
        Solid(box((2, 30), (-21.5, -19.5), (9, 22), 2), FRAME),
        Solid(box((2, 30), (19.5, 21.5), (9, 22), 2), FRAME),
        Solid(box((2, 30), (-21.5, 21.5), (16.5, 18.5), 2), FRAME),
    ]
    for side in (-1, 1):
        y = 21.5 * side
        ear = [(4, y, 18), (20, y, 18), (4, y + 2 * side, 18), (20, y + 2 * side, 18),
               (2, y + 5 * side, 46), (9, y + 5 * side, 46), (2, y + 7 * side, 46), (9, y + 7 * side, 46)]
        pieces.append(Solid(hull(ear), FRAME))
        eye = moved(disc(5, (43, 44.5), sides=16), [[0, 0, 1, 0], [1, 0, 0, 8.5 * side * MM], [0, 1, 0, 5 * MM], [0, 0, 0, 1]])
        pieces.append(Solid(eye, BLACK, False))
    pieces.append(Solid(box((43, 47), (-6, 6), (-12, -6), 1), BLACK, False))
    return pieces


def shank() -> Shape:
    """Rod of the lower leg, radius 5 mm, from z = 0 down to -53 mm, with the collar that holds it."""
    return [Solid(disc(5, (-53, 0), sides=14), FRAME), Solid(disc(8, (-6, 0), sides=14), GREY, False)]


def foot(corner: float, radius: float) -> trimesh.Trimesh:
    """Rubber foot as a convex mesh: the hull of its four contact spheres (corner, radius [m]) and of its neck.

    Origin at the tip's height under the shank's axis: the spheres touch z = 0.
    """
    ball = trimesh.creation.icosphere(subdivisions=1, radius=radius).vertices
    ball *= radius / np.abs(ball[:, 2]).max()  # reaches down to the sphere's lowest point
    corners = [ball + np.array([sx * corner, sy * corner, radius]) for sx in (-1, 1) for sy in (-1, 1)]
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    neck = np.column_stack([8 * MM * np.cos(angle), 8 * MM * np.sin(angle), np.full(12, 14 * MM)])
    mesh: trimesh.Trimesh = trimesh.convex.convex_hull(np.vstack([*corners, neck]))
    return mesh


def part_shapes(sizes: dict[str, tuple[float, float, float]], corner: float, radius: float) -> dict[str, Shape]:
    """Shapes of all parts by name; `sizes` [m] (data/parts.csv) set those that are plain plates and blocks."""
    drawn: dict[str, Callable[[], Shape]] = {
        "ax12a": ax12a, "f1": f1, "f2": f2, "f3": f3, "cm530": cm530, "lbs10": lbs10, "head_shell": head_shell, "shank": shank,
    }
    plain = {"zig110a": GREEN, "tail_frame": FRAME, "body_frame": FRAME, "body_hardware": GREY, "leg_hardware": GREY}
    shapes = {name: draw() for name, draw in drawn.items()}
    shapes |= {name: block(np.divide(sizes[name], MM), colour) for name, colour in plain.items()}
    shapes["foot"] = [Solid(foot(corner, radius), RUBBER)]
    return shapes
