"""The SO-101 arm as an SDF and its servos' nominal constants, out of the inertias-only URDF and published numbers.

Servos. Feetech's STS3215 as Rhoban/bam published it (params/feetech_sts3215_7_4V/m1.json: kt, R, armature, friction;
bam/feetech/actuator.py: 0.166 duty per radian and unit of the P register, found with an oscilloscope). The recorder of these
programmes (isaac-sim2real/sage, so101_lerobot_collector.py) writes P 16, I 0, D 32, and half the torque for the gripper.
Which supply the arm had nobody says; 7.4 V is that of the published servo. What D does is not published and is not in the law.

Zero and sign of the joints are the URDF's; `zero.py` checks them against the recordings.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from workbench.files import InputError
from workbench.files.yaml_file import yaml_text
from workbench.recording.joint_names import URDF_JOINTS
from workbench.robot import ServoConstants

BASE = "base_link"
COUNT = 2 * np.pi / 4096
"""A servo's encoder count [rad]."""
KT, RESISTANCE, ARMATURE, COULOMB, VISCOUS = 1.21164, 2.67617, 0.028403, 0.052393, 0.059085
"""bam's M1 of the 7.4 V servo: N m/A, ohm, kg m^2, N m, N m s/rad."""
VOLTAGE = 7.4
DUTY_PER_RADIAN = 16 * 0.166
GRIPPER_LIMIT = 0.5
"""Of full duty."""


def arm_sdf(urdf: Path) -> str:
    """The URDF's links, inertias and turning joints as an SDF that stands on the world, joints named as in the recordings."""
    try:
        robot = ElementTree.parse(urdf).getroot()
    except (OSError, ElementTree.ParseError) as e:
        raise InputError(urdf, f"cannot be read as URDF: {e}") from None
    root = Element("sdf", {"version": "1.9"})
    model = SubElement(root, "model", {"name": "so101"})
    turning = {j.get("name", ""): j for j in robot.findall("joint") if j.get("type") == "revolute"}
    missing = [name for name in URDF_JOINTS.values() if name not in turning]
    if missing:
        raise InputError(urdf, f"expected a revolute joint '{missing[0]}'")
    carried = {_link(j, "child"): name for name, j in ((n, turning[u]) for n, u in URDF_JOINTS.items())}
    for link in robot.findall("link"):
        name = link.get("name", "")
        if name == BASE or name in carried:
            _write_link(model, link, carried.get(name))
    weld = SubElement(model, "joint", {"name": "stand", "type": "fixed"})
    SubElement(weld, "parent").text, SubElement(weld, "child").text = "world", BASE
    for name, u in URDF_JOINTS.items():
        _write_joint(model, name, turning[u])
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _link(joint: Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _pose(origin: Element | None) -> str:
    if origin is None:
        return "0 0 0 0 0 0"
    return f"{origin.get('xyz', '0 0 0')} {origin.get('rpy', '0 0 0')}"


def _write_link(model: Element, link: Element, joint: str | None) -> None:
    out = SubElement(model, "link", {"name": link.get("name", "")})
    if joint is not None:
        SubElement(out, "pose", {"relative_to": joint}).text = "0 0 0 0 0 0"
    given = link.find("inertial")
    assert given is not None
    inertial = SubElement(out, "inertial")
    SubElement(inertial, "pose").text = _pose(given.find("origin"))
    mass, inertia = given.find("mass"), given.find("inertia")
    assert mass is not None
    assert inertia is not None
    SubElement(inertial, "mass").text = mass.get("value")
    matrix = SubElement(inertial, "inertia")
    for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"):
        SubElement(matrix, key).text = inertia.get(key)


def _write_joint(model: Element, name: str, joint: Element) -> None:
    parent = _link(joint, "parent")
    out = SubElement(model, "joint", {"name": name, "type": "revolute"})
    SubElement(out, "pose", {"relative_to": parent}).text = _pose(joint.find("origin"))
    SubElement(out, "parent").text, SubElement(out, "child").text = parent, _link(joint, "child")
    axis, given, limit = SubElement(out, "axis"), joint.find("axis"), joint.find("limit")
    assert given is not None
    assert limit is not None
    SubElement(axis, "xyz").text = given.get("xyz")
    limits = SubElement(axis, "limit")
    for key in ("lower", "upper", "effort"):
        SubElement(limits, key).text = limit.get(key)


def servo(jaw_range: float | None = None) -> ServoConstants:
    """Nominal constants of one servo; `jaw_range` [rad]: of the jaw, whose angle the recordings give as a share of this range.

    In shares, speeds and the error are smaller by the range. Stiffness, damping and inertia are kept as numbers, so that torques
    are smaller by it too: what hangs on the jaw, 12 g, weighs nothing beside its servo. Half the duty is half the supply and
    twice the gain.
    """
    s, part = (1.0, 1.0) if jaw_range is None else (jaw_range, GRIPPER_LIMIT)
    return ServoConstants(
        model="STS3215" if jaw_range is None else "STS3215, per share of the jaw's range, half duty",
        stall_torque=round(KT * VOLTAGE / RESISTANCE / s, 5), no_load_speed=round(VOLTAGE / KT / s, 5), rated_voltage=VOLTAGE,
        supply_voltage=VOLTAGE * part, coulomb_friction=round(COULOMB / s, 6), viscous_friction=VISCOUS,
        reflected_inertia=ARMATURE, proportional_gain=round(s * DUTY_PER_RADIAN / part, 5),
        compliance_slope=None, compliance_margin=None, punch=None)


def servo_yaml(constants: ServoConstants) -> str:
    """servo.yaml (docs/formats.md, section 4)."""
    return yaml_text(constants.as_dict())
