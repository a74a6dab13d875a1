"""Which part sits where in which link of the puppy, and the joints between the links, in the neutral pose.

All link frames are parallel to the world in the neutral pose (x forward, y left, z up), origins on their joints' axes;
the body's lies midway between the hips at the height of the top joints' axes. Lengths from data/parts.csv.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.types import Array

X, Y, Z = np.eye(3)
LEGS = ("fl", "fr", "bl", "br")
MM = 1e-3
BODY_Z = 0.0175  # plates of the body lie on the top servos, whose half width is 16 mm


@dataclass(frozen=True)
class PartsTable:
    """data/parts.csv: mass [kg] and size [m] by part, and lengths [m] by name."""

    mass: Mapping[str, float]
    size: Mapping[str, tuple[float, float, float]]
    length: Mapping[str, float]


@dataclass(frozen=True)
class Placement:
    """A part in a link: rotation (columns are the part's axes) and origin [m] in the link's frame L."""

    part: str
    R_LP: Array
    p_LP: Array


@dataclass(frozen=True)
class Link:
    """A link: where its frame stands in the body's frame B in neutral [m], the joint that carries it, its parent and parts."""

    name: str
    p_BL: Array
    joint: str | None
    parent: str | None
    parts: tuple[Placement, ...]


def read_parts(path: Path) -> PartsTable:
    """Reads data/parts.csv (lines that start with # are comments)."""
    with path.open(encoding="utf-8", newline="") as f:
        rows = list(csv.DictReader(line for line in f if not line.startswith("#")))
    parts = [r for r in rows if r["kind"] == "part"]
    return PartsTable(
        mass={r["name"]: float(r["mass"]) for r in parts},
        size={r["name"]: (float(r["x"]), float(r["y"]), float(r["z"])) for r in parts},
        length={r["name"]: float(r["x"]) for r in rows if r["kind"] == "dimension"},
    )


def place(part: str, at: tuple[float, float, float] | Array = (0, 0, 0), x: Array | None = None, y: Array | None = None,
          z: Array | None = None) -> Placement:
    """A part at a point [m], with its axes x and y, or y and z, given in the link's frame; none: parallel to the link."""
    if z is None:
        x, y = (X if x is None else x), (Y if y is None else y)
    elif y is not None:
        x = np.cross(y, z)
    else:
        raise ValueError("expected z together with y")
    assert x is not None
    assert y is not None
    return Placement(part, np.column_stack([x, y, np.cross(x, y)]), np.asarray(at, dtype=float))


def links(d: Mapping[str, float]) -> list[Link]:
    """All 16 links, parents before children. d: lengths [m] by name.

    Servos' horns look where the joints' signs say (data/joint_signs.csv). The top servos are drawn turned about in place, with
    the bracket on the idler's side; a robot that has these signs carries them on the other side of the leg's bracket.
    """
    hip_x, hip_y = d["wheelbase"] / 2, d["half_track"]
    servo_x = hip_x - d["top_horn_to_middle"]  # centres of the top servos
    tail_x = -servo_x + (19 + 2 + 26) * MM  # hind servos' backs, gap, F2 of the tail joint
    neck = np.array([servo_x + 19 * MM, 0.0, BODY_Z + 18 * MM])
    tilt = np.deg2rad(35)
    along = np.array([np.sin(tilt), 0, np.cos(tilt)])
    tail = np.array([tail_x, 0.0, 0.0])

    body = Link("body_link", np.zeros(3), None, None, (
        *(place("ax12a", (servo_x, s * hip_y, 0), z=-X, y=s * Y) for s in (1, -1)),
        place("ax12a", tail, z=Y, y=-X),
        place("ax12a", neck, z=-Y, y=X),
        place("body_frame", (0, 0, BODY_Z)),
        place("body_hardware", (-0.006, 0, BODY_Z + 3.5 * MM)),
        place("lbs10", (-0.026, 0, BODY_Z + 16 * MM)),
        place("cm530", (-0.032, 0, BODY_Z + 43 * MM)),
        place("zig110a", (0.0, 0, BODY_Z + 63 * MM)),
    ))
    back_servo = np.array([-servo_x, 0, 0]) - tail
    tail_link = Link("tail_link", tail, "tail", "body_link", (
        *(place("ax12a", back_servo + s * hip_y * Y, z=-X, y=s * Y) for s in (1, -1)),
        place("f2", z=Y, y=X),
        place("tail_frame", back_servo - BODY_Z * Z),
    ))
    neck_link = Link("neck_link", neck, "neck", "body_link", (
        place("f2", z=Y, y=-along), place("f2", along * d["neck_length"], z=Y, y=along),
    ))
    head_link = Link("head_link", neck + along * d["neck_length"], "head", "neck_link",
                     (place("ax12a", z=Y, y=-X), place("head_shell")))
    return [body, tail_link, *(link for leg in LEGS for link in _leg(leg, d, hip_x, hip_y)), neck_link, head_link]


def _leg(leg: str, d: Mapping[str, float], hip_x: float, hip_y: float) -> list[Link]:
    front, left = leg[0] == "f", leg[1] == "l"
    side, ahead = (1 if left else -1), (1 if front else -1)
    top = np.array([ahead * hip_x, side * hip_y, 0])
    middle = top - [0, 0, d["top_to_middle"]]
    bottom = middle - [0, 0, d["thigh"]]
    length = d["front_shank"] if front else d["back_shank"]
    foot_x = 0.0 if front else d["back_foot_offset"]
    horn = -ahead * side * Y  # inwards in front, outwards behind
    lower = place("f2", z=Y, y=Z) if front else place("f1", x=-X, y=Z)
    base = (26 if front else 23) * MM
    return [
        Link(f"{leg}t_link", top, f"{leg}t", "body_link" if front else "tail_link",
             (place("f1", (0, 0, -d["top_to_middle"]), x=Z, y=ahead * X),)),
        Link(f"{leg}m_link", middle, f"{leg}m", f"{leg}t_link", (
            place("ax12a", z=horn, y=Z),
            place("f3", (0, 0, -40.5 * MM), x=Y, y=X),
            place("f3", (0, 0, -42.5 * MM), x=Y, y=-X),
            place("ax12a", (0, 0, -d["thigh"]), z=horn, y=-Z),
            place("leg_hardware", (0, 0, -41.5 * MM)),
        )),
        Link(f"{leg}b_link", bottom, f"{leg}b", f"{leg}m_link", (
            lower,
            place("shank", (foot_x, 0, -base)),
            place("foot", (foot_x, 0, -length)),
        )),
    ]
