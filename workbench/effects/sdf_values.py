"""Numbers in an SDF's elements: poses and inertias, read and written."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

import numpy as np

from workbench.files import InputError
from workbench.types import Array

_MOMENTS = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}


def format_numbers(values: Array) -> str:
    """Numbers as SDF text, exact."""
    return " ".join(repr(float(v)) for v in np.ravel(values))


def numbers(element: Element | None, count: int) -> Array:
    """The numbers in an element; `count` zeros if it is missing or empty."""
    found = (element.text or "").split() if element is not None else []
    return np.array([float(v) for v in found]) if found else np.zeros(count)


def set_child(element: Element, tag: str, value: float | str) -> None:
    """Sets the text of the element's only child with this tag, which is created if it is missing."""
    child = element.find(tag)
    child = SubElement(element, tag) if child is None else child
    child.text = value if isinstance(value, str) else repr(value)


def write_pose(element: Element, p: Array, R: Array, relative_to: str | None = None) -> None:
    """Replaces the element's pose."""
    for old in element.findall("pose"):
        element.remove(old)
    pose = SubElement(element, "pose", {"relative_to": relative_to} if relative_to else {})
    pose.text = format_numbers(np.concatenate([p, _rpy(R)]))


def shift_pose(shape: Element, shift: Array) -> None:
    """Moves a shape of a link by (3,) in the link's frame."""
    pose = shape.find("pose")
    pose = SubElement(shape, "pose") if pose is None else pose
    if pose.get("relative_to"):
        raise InputError(None, f"shape '{shape.get('name')}': expected a pose relative to its link, not to another frame")
    values = (pose.text or "").split() or ["0"] * 6
    pose.text = " ".join([format_numbers(np.array([float(v) for v in values[:3]]) + shift), *values[3:]])


def read_inertia(inertial: Element) -> tuple[float, Array, Array]:
    """Mass [kg], centre (3,) [m], and inertia (3, 3) [kg m^2] about it, both in the link's axes; SDF's own defaults."""
    pose = inertial.find("pose")
    values = numbers(pose, 6)
    R = _rotation(values[3:], pose)
    inertia = np.zeros((3, 3))
    for tag, (i, k) in _MOMENTS.items():
        inertia[i, k] = inertia[k, i] = float(inertial.findtext(f"inertia/{tag}", "1" if i == k else "0"))
    return float(inertial.findtext("mass", "1")), values[:3], R @ inertia @ R.T


def write_inertia(inertial: Element, mass: float, center: Array, inertia: Array) -> None:
    """Writes mass, centre and inertia in the form that `read_inertia` returns."""
    write_pose(inertial, center, np.eye(3))
    set_child(inertial, "mass", float(mass))
    moments = inertial.find("inertia")
    moments = SubElement(inertial, "inertia") if moments is None else moments
    for tag, (i, k) in _MOMENTS.items():
        set_child(moments, tag, float(inertia[i, k]))


def _rotation(values: Array, pose: Element | None) -> Array:
    from pydrake.common.eigen_geometry import Quaternion
    from pydrake.math import RollPitchYaw, RotationMatrix

    if pose is not None and pose.get("rotation_format") == "quat_xyzw":
        x, y, z, w = values
        return np.asarray(RotationMatrix(Quaternion(w, x, y, z)).matrix())
    degrees = pose is not None and pose.get("degrees") in ("true", "1")
    return np.asarray(RollPitchYaw(np.deg2rad(values) if degrees else values).ToRotationMatrix().matrix())


def _rpy(R: Array) -> Array:
    from pydrake.math import RollPitchYaw, RotationMatrix

    return np.asarray(RollPitchYaw(RotationMatrix(R)).vector())
