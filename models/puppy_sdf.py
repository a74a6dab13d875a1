"""The puppy's SDF: masses and inertias from the parts, visuals, contact shapes, joints and their signs."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scipy.optimize import brentq

from models.puppy_assembly import Link, PartsTable, Placement
from models.puppy_shapes import Shape
from workbench.robot import COUNT, ServoConstants
from workbench.types import Array

GEAR_RATIO = 254  # AX-12A manual
VELOCITY = 6.18  # rad/s, no load at 12 V; effort is stall at 12 V (AX-12A manual)
LOWER, UPPER = (0 - 512) * COUNT, (1023 - 512) * COUNT  # goal positions 0 and 1023

STIFFNESS, DAMPING = 1e4, 1e2  # N/m and N s/m of one contact sphere (thesis, 6.9)
FRICTION_STATIC, FRICTION = 0.7, 0.5  # thesis, 6.9; a discrete plant knows the dynamic one alone
IMPACT_SPEED = 0.1  # m/s at which damping is translated: a foot that comes down at the walk's pace
HYDROELASTIC_MODULUS = 1e6  # Pa; a foot flat on rigid ground then gives 4.2e4 N/m (measured), its four spheres 4e4 N/m


@dataclass(frozen=True)
class Inertia:
    """Mass [kg], centre of mass [m] and rotational inertia about it [kg m2], in the link's axes."""

    mass: float
    com: Array
    I_com: Array


def part_inertia(shape: Shape, mass: float) -> Inertia:
    """Inertia of a part whose massive solids share `mass` [kg] by volume, in the part's axes."""
    pieces = [s.mesh for s in shape if s.massive]
    volume = sum(p.volume for p in pieces)
    return combined([Inertia(mass * p.volume / volume, p.center_mass, p.moment_inertia * mass / volume) for p in pieces])


def combined(parts: list[Inertia]) -> Inertia:
    """Sum by the parallel axis theorem."""
    mass = sum(p.mass for p in parts)
    com = np.asarray(sum(p.mass * p.com for p in parts) / mass)
    total = np.zeros((3, 3))
    for p in parts:
        r = p.com - com
        total += p.I_com + p.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return Inertia(mass, com, total)


def link_inertia(link: Link, parts: Mapping[str, Inertia]) -> Inertia:
    """Inertia of a link from its placed parts."""
    placed = []
    for at in link.parts:
        p = parts[at.part]
        placed.append(Inertia(p.mass, at.p_LP + at.R_LP @ p.com, at.R_LP @ p.I_com @ at.R_LP.T))
    return combined(placed)


def hunt_crossley_dissipation(mass: float, stiffness: float = STIFFNESS, damping: float = DAMPING,
                              speed: float = IMPACT_SPEED) -> float:
    """Dissipation d [s/m] of Drake's F = K x (1 + d v) that stops `mass` [kg], landing at `speed`, at the same depth as the
    thesis's F = K x + D v (equation 6.3); both do the same work until then.

    Depth of the linear law: its first standstill. Of Hunt-Crossley's: v/d - ln(1 + d v)/d^2 = K x^2 / (2 m), from
    m v dv = -K x (1 + d v) dx.
    """
    omega = np.sqrt(stiffness / mass)
    zeta = damping / (2 * mass * omega)
    if zeta >= 1:
        raise ValueError("expected an underdamped foot; the closed form of the depth is for that")
    ratio = np.sqrt(1 - zeta**2)
    depth = speed / omega * np.exp(-zeta / ratio * np.arctan2(ratio, zeta))
    work = stiffness * depth**2 / (2 * mass)
    return float(brentq(lambda d: speed / d - np.log1p(d * speed) / d**2 - work, 1e-3, 1e4))


def read_signs(path: Path) -> dict[str, tuple[str, int]]:
    """data/joint_signs.csv: axis (x or y) and sign by joint."""
    with path.open(encoding="utf-8", newline="") as f:
        return {r["joint"]: (r["axis"], int(r["sign"])) for r in csv.DictReader(f)}


def number(value: float) -> str:
    """Shortest text to 9 significant digits, so that the file is the same on every machine."""
    text = f"{value + 0.0:.9g}"
    return "0" if float(text) == 0 or abs(float(text)) < 1e-15 else text


def numbers(values: Iterable[float]) -> str:
    return " ".join(number(float(v)) for v in values)


def sdf(tree: list[Link], table: PartsTable, shapes: Mapping[str, Shape], signs: Mapping[str, tuple[str, int]]) -> str:
    """The whole file."""
    parts = {name: part_inertia(shapes[name], m) for name, m in table.mass.items()}
    inertias = {link.name: link_inertia(link, parts) for link in tree}
    total = sum(i.mass for i in inertias.values())
    dissipation = hunt_crossley_dissipation(total / 4)
    d = table.length
    height = d["top_to_middle"] + d["thigh"] + d["front_shank"]
    lines = [
        '<?xml version="1.0"?>',
        "<!-- Made by models/build_puppy.py from data/parts.csv and data/joint_signs.csv; do not edit.",
        "     Zero of every joint is the neutral pose, servo goal 512. Feet carry two contact models: foot_sphere_0..3, the",
        "     thesis's corners, and foot_hydro, compliant hydroelastic. Use one set: the workbench's station takes the other",
        "     away by name; in a plant that keeps both, both act at once and the feet are too stiff. -->",
        '<sdf version="1.9" xmlns:drake="http://drake.mit.edu">',
        '<model name="puppy">',
        f"<pose>0 0 {number(height)} 0 0 0</pose>",
    ]
    for link in tree:
        lines += _link(link, inertias[link.name], d, dissipation)
    origin = {link.name: link.p_BL for link in tree}
    for link in tree:
        if link.joint is not None:
            assert link.parent is not None
            lines += _joint(link, *signs[link.joint], origin[link.parent])
    return "\n".join([*lines, "</model>", "</sdf>", ""])


def _link(link: Link, inertia: Inertia, d: Mapping[str, float], dissipation: float) -> list[str]:
    I = inertia.I_com
    moments = {"ixx": I[0, 0], "iyy": I[1, 1], "izz": I[2, 2], "ixy": I[0, 1], "ixz": I[0, 2], "iyz": I[1, 2]}
    lines = [
        f'<link name="{link.name}">',
        f"<pose>{numbers(link.p_BL)} 0 0 0</pose>",
        f"<inertial><pose>{numbers(inertia.com)} 0 0 0</pose><mass>{number(inertia.mass)}</mass>",
        "<inertia>" + "".join(f"<{k}>{number(v)}</{k}>" for k, v in moments.items()) + "</inertia></inertial>",
    ]
    for i, at in enumerate(link.parts):
        lines.append(f'<visual name="{at.part}_{i}"><pose>{_pose(at)}</pose><geometry><mesh>'
                     f"<uri>package://puppy/meshes/{at.part}.gltf</uri></mesh></geometry></visual>")
    return [*lines, *_collisions(link, d, dissipation), "</link>"]


def _pose(at: Placement) -> str:
    """x y z roll pitch yaw."""
    R = at.R_LP
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    if abs(np.cos(pitch)) > 1e-9:
        roll, yaw = np.arctan2(R[2, 1], R[2, 2]), np.arctan2(R[1, 0], R[0, 0])
    else:
        roll, yaw = np.arctan2(-R[1, 2], R[1, 1]), 0.0
    return numbers([*at.p_LP, roll, pitch, yaw])


def _collisions(link: Link, d: Mapping[str, float], dissipation: float) -> list[str]:
    """Shapes that can touch: belly, thighs, shanks and feet."""
    if link.name == "body_link":
        return _collision("belly", [-0.03, 0, 0.04], _box(0.10, 0.068, 0.07), dissipation)
    if link.name.endswith("m_link"):
        return _collision("thigh", [0, 0, -d["thigh"] / 2], _box(0.032, 0.042, d["thigh"] + 0.022), dissipation)
    if not link.name.endswith("b_link"):
        return []
    front = link.name[0] == "f"
    tip = -(d["front_shank"] if front else d["back_shank"])
    x = 0.0 if front else d["back_foot_offset"]
    lines = _collision("shank", [x, 0, tip / 2 - 0.005],
                       f"<cylinder><radius>0.006</radius><length>{number(-tip - 0.03)}</length></cylinder>", dissipation)
    c, r = d["foot_corner"], d["foot_radius"]
    for i, (sx, sy) in enumerate([(-1, -1), (-1, 1), (1, -1), (1, 1)]):
        lines += _collision(f"foot_sphere_{i}", [x + sx * c, sy * c, tip + r], f"<sphere><radius>{number(r)}</radius></sphere>",
                            dissipation)
    hull = "<mesh><uri>package://puppy/meshes/foot.obj</uri><drake:declare_convex/></mesh>"
    return lines + _collision("foot_hydro", [x, 0, tip], hull, dissipation, compliant=True)


def _box(x: float, y: float, z: float) -> str:
    return f"<box><size>{numbers([x, y, z])}</size></box>"


def _collision(name: str, at: list[float], geometry: str, dissipation: float, compliant: bool = False) -> list[str]:
    tag, value = ("hydroelastic_modulus", HYDROELASTIC_MODULUS) if compliant else ("point_contact_stiffness", STIFFNESS)
    stiffness = ("<drake:compliant_hydroelastic/>" if compliant else "") + f"<drake:{tag}>{number(value)}</drake:{tag}>"
    return [
        f'<collision name="{name}"><pose>{numbers(at)} 0 0 0</pose><geometry>{geometry}</geometry><drake:proximity_properties>',
        f"{stiffness}<drake:hunt_crossley_dissipation>{number(dissipation)}</drake:hunt_crossley_dissipation>",
        f"<drake:mu_static>{number(FRICTION_STATIC)}</drake:mu_static><drake:mu_dynamic>{number(FRICTION)}</drake:mu_dynamic>"
        "</drake:proximity_properties></collision>",
    ]


def _joint(link: Link, axis: str, sign: int, parent_at: Array) -> list[str]:
    servo = ServoConstants()
    xyz = {"x": [sign, 0, 0], "y": [0, sign, 0]}[axis]
    return [
        f'<joint name="{link.joint}" type="revolute"><parent>{link.parent}</parent><child>{link.name}</child>',
        f"<axis><xyz>{numbers(xyz)}</xyz><limit><lower>{number(LOWER)}</lower><upper>{number(UPPER)}</upper>"
        f"<effort>{number(servo.stall_torque)}</effort><velocity>{number(VELOCITY)}</velocity></limit>"
        "<dynamics><damping>0</damping></dynamics></axis>",
        f"<drake:rotor_inertia>{number(servo.reflected_inertia / GEAR_RATIO**2)}</drake:rotor_inertia>"
        f"<drake:gear_ratio>{GEAR_RATIO}</drake:gear_ratio></joint>",
    ]


def mesh_gltf(shape: Shape) -> bytes:
    """glTF of a part in one file (Drake's Meshcat shows no .glb), one geometry for each colour, flat shaded; y up as glTF
    wants, so that Drake shows it z up."""
    scene = trimesh.Scene()
    for colour in sorted({s.colour for s in shape}):
        mesh = trimesh.util.concatenate([s.mesh for s in shape if s.colour == colour])
        mesh.apply_transform([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
        mesh.unmerge_vertices()
        mesh.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(
            baseColorFactor=[*colour, 255], metallicFactor=0.0, roughnessFactor=0.7))
        scene.add_geometry(mesh, geom_name="_".join(map(str, colour)))
    return bytes(trimesh.exchange.gltf.export_gltf(scene, merge_buffers=True, embed_buffers=True)["model.gltf"])


def mesh_obj(mesh: trimesh.Trimesh) -> str:
    """Wavefront text of a convex mesh."""
    vertices = [f"v {numbers(v)}" for v in mesh.vertices]
    return "\n".join([*vertices, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces), ""])
