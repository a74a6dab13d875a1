"""Robots as people publish them, made here: URDFs with STL meshes that look and touch, named as their exporters name them.

A biped as onshape-to-robot writes it (`package:///`), a quadruped as a ROS workspace has it (`package://NAME/meshes/`), and one
as SolidWorks writes it (backslashes, upper-case STL, a base of no mass under the trunk).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import trimesh

SERVO = """model: STS3215
stall_torque: 1.9
no_load_speed: 5.2
rated_voltage: 7.4
supply_voltage: 7.4
proportional_gain: 6.0
coulomb_friction: 0.05
viscous_friction: 0.01
reflected_inertia: 0.0045
"""


@dataclass(frozen=True)
class Made:
    """A robot: uri of its meshes with {} for the name, legs by name and place (x, y) [m], joints of a leg with their axes."""

    name: str
    uri: str
    legs: dict[str, tuple[float, float]]
    joints: tuple[tuple[str, str], ...]
    massless_base: bool = False


ROBOTS = (
    Made("duck", "package:///{}.stl", {"left": (0.0, 0.04), "right": (0.0, -0.04)},
         (("hip_yaw", "0 0 1"), ("hip_roll", "1 0 0"), ("hip_pitch", "0 1 0"), ("knee", "0 1 0"), ("ankle", "0 1 0"))),
    Made("spot", "package://mini_ros/meshes/{}.stl",
         {"front_left": (0.09, 0.04), "front_right": (0.09, -0.04), "back_left": (-0.09, 0.04), "back_right": (-0.09, -0.04)},
         (("shoulder", "1 0 0"), ("leg", "0 1 0"), ("foot", "0 1 0"))),
    Made("dingo", "..\\meshes\\{}.STL",
         {"FL": (0.1, 0.05), "FR": (0.1, -0.05), "RL": (-0.1, 0.05), "RR": (-0.1, -0.05)},
         (("Hip", "1 0 0"), ("Upper", "0 1 0"), ("Lower", "0 1 0")), massless_base=True),
)


def write_robot(folder: Path, made: Made) -> Path:
    """Writes the URDF, its meshes and servo.yaml; the URDF's path."""
    for sub in ("urdf", "meshes"):
        (folder / sub).mkdir(parents=True, exist_ok=True)
    root = folder / "urdf" if made.uri.startswith("package:///") else folder / "meshes"
    suffix = made.uri.rsplit(".", 1)[1]
    for name, size in (("trunk", (160, 90, 50)), ("segment", (18, 18, 60)), ("tip", (22, 18, 14))):
        trimesh.creation.box(size).export(root / f"{name}.{suffix}", file_type="stl")
    if "mini_ros" in made.uri:
        (folder / "package.xml").write_text("<package><name>mini_ros</name></package>")
    links, joints = [], []
    if made.massless_base:
        links.append('<link name="base_link"/>')
        joints.append('<joint name="base_to_trunk" type="fixed"><parent link="base_link"/><child link="trunk"/></joint>')
    links.append(_link(made, "trunk", "trunk", 0.6, "0 0 0", (9e-4, 1.6e-3, 2e-3)))
    for leg, (x, y) in made.legs.items():
        above = "trunk"
        for i, (name, axis) in enumerate(made.joints):
            last, bend = i == len(made.joints) - 1, axis == "0 1 0"
            link = f"{leg}_{name}_link"
            mesh = "tip" if last else "segment"
            mass, at = (0.03, "0 0 -0.05") if last else (0.07, "0 0 -0.03") if bend else (0.04, "0 0 0")
            links.append(_link(made, link, mesh, mass, at, (4e-5, 4e-5, 1e-5)))
            place = f"{x} {y} -0.02" if i == 0 else ("0 0 -0.06" if made.joints[i - 1][1] == "0 1 0" else "0 0 -0.015")
            joints.append(f'<joint name="{leg}_{name}" type="revolute"><parent link="{above}"/><child link="{link}"/>'
                          f'<origin xyz="{place}"/><axis xyz="{axis}"/>'
                          '<limit lower="-1.5" upper="1.5" effort="1.9" velocity="5.2"/></joint>')
            above = link
    path = folder / "urdf" / f"{made.name}.urdf"
    path.write_text(f'<?xml version="1.0"?>\n<robot name="{made.name}">\n' + "\n".join([*links, *joints]) + "\n</robot>\n")
    (folder / "servo.yaml").write_text(SERVO)
    return path


def _link(made: Made, name: str, mesh: str, mass: float, at: str, moments: tuple[float, float, float]) -> str:
    shape = (f'<origin xyz="{at}"/><geometry><mesh filename="{made.uri.format(mesh)}" scale="0.001 0.001 0.001"/></geometry>')
    collision = f"<collision>{shape}</collision>" if mesh != "segment" else ""
    ixx, iyy, izz = moments
    return (f'<link name="{name}"><inertial><origin xyz="{at}"/><mass value="{mass}"/>'
            f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>'
            f"<visual>{shape}</visual>{collision}</link>")
