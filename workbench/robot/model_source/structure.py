"""Values in an SDF's own text that no robot can have: masses, inertias, limits, loops."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from workbench.files import InputError

_RADIANS = 4 * math.pi
"""Limits beyond are degrees."""
_TURN = 2 * math.pi + 0.01
"""The same of a pose's angles."""


def check_structure(path: Path, sdf: Element) -> list[str]:
    """A line for each thing that is doubtful in an SDF; InputError where it cannot be built: a negative mass, limits that are
    swapped, a link that hangs on two joints or on itself."""
    problems = []
    for model in sdf.iter("model"):
        _check_tree(path, model)
        hangs = {(j.findtext("child") or "").strip(): j.get("type") for j in model.findall("joint")}
        for link in model.findall("link"):
            problems += _inertia_problems(path, link, hangs.get(link.get("name") or "") != "fixed")
        for joint in model.findall("joint"):
            problems += _limit_problems(path, joint)
        for part in (*model.findall("link"), *model.findall("joint")):
            problems += _pose_problems(part)
    return problems


def _check_tree(path: Path, model: Element) -> None:
    parent: dict[str, tuple[str, str]] = {}
    for joint in model.findall("joint"):
        name = joint.get("name") or ""
        above, below = ((joint.findtext(tag) or "").strip() for tag in ("parent", "child"))
        if below in parent:
            raise InputError(path, f"link '{below}' hangs on joints '{parent[below][0]}' and '{name}': a kinematic loop; "
                                   "expected a tree")
        parent[below] = name, above
    for link in parent:
        way, at = [], link
        while at in parent:
            way.append(parent[at][0])
            at = parent[at][1]
            if at == link:
                raise InputError(path, f"joints {', '.join(way)} form a kinematic loop; expected a tree")
            if len(way) > len(parent):
                break


def _inertia_problems(path: Path, link: Element, moved: bool) -> list[str]:
    name = f"link '{link.get('name', '')}'"
    inertial = link.find("inertial")
    if inertial is None:
        return [f"{name} has no <inertial>: SDF then gives it 1 kg and 1 kg m^2"] if moved or len(link) else []
    if inertial.get("auto") in ("true", "1"):
        raise InputError(path, f"{name}: <inertial auto>: expected <mass> and <inertia> in numbers, which effects on them change")
    mass = float(inertial.findtext("mass") or "1")
    if mass < 0:
        raise InputError(path, f"{name}: mass {mass:g} kg; expected 0 or more")
    moments = np.zeros((3, 3))
    for i, k, tag in ((0, 0, "ixx"), (1, 1, "iyy"), (2, 2, "izz"), (0, 1, "ixy"), (0, 2, "ixz"), (1, 2, "iyz")):
        moments[i, k] = moments[k, i] = float(inertial.findtext(f"inertia/{tag}") or ("1" if i == k else "0"))
    if mass == 0:  # that nothing weighs anything is told of all that is fixed together
        odd = f"{name} has moments of inertia but no mass: Drake takes a ball of water of 1 kg instead"
        return [odd] if moments.any() else []
    if not moments.any():
        return [f"{name} weighs {mass:g} kg and has no rotational inertia, as if it were a point"] if moved else []
    principal = np.sort(np.linalg.eigvalsh(moments))
    if principal[0] < 0 or principal[0] + principal[1] < principal[2] * (1 - 1e-7):
        listed = ", ".join(f"{p:.3g}" for p in principal)
        return [f"{name}: no body has principal moments of inertia of {listed} kg m^2 (each is at most the sum of the others); "
                f"Drake takes a ball of water of {mass:g} kg about its centre of mass instead"]
    return []


def _pose_problems(part: Element) -> list[str]:
    """Of a link, its shapes, or a joint: angles of more than a turn."""
    for pose in part.iter("pose"):
        words = (pose.text or "").split()
        if len(words) == 6 and pose.get("degrees") not in ("true", "1") and max(abs(float(w)) for w in words[3:]) > _TURN:
            return [f"{part.tag} '{part.get('name', '')}': a pose of {' '.join(words[3:])} rad (roll, pitch, yaw) is more than a "
                    "turn: are the angles in degrees?"]
    return []


def _limit_problems(path: Path, joint: Element) -> list[str]:
    limit = joint.find("axis/limit")
    if limit is None or joint.get("type") == "fixed":
        return []
    lower, upper = (float(limit.findtext(tag) or default) for tag, default in (("lower", "-inf"), ("upper", "inf")))
    name = f"joint '{joint.get('name', '')}'"
    if lower > upper:
        raise InputError(path, f"{name}: lower limit {lower:g} is above the upper, {upper:g}")
    if joint.get("type") != "revolute":
        return []
    out = [f"{name}: its limits are equal, {math.degrees(lower):.4g} deg: it cannot move"] if lower == upper else []
    if lower > 0 or upper < 0:
        at = lower if lower > 0 else upper
        out.append(f"{name}: zero lies outside its limits, {math.degrees(lower):.4g} to {math.degrees(upper):.4g} deg: it starts "
                   f"at {math.degrees(at):.4g} deg")
    if max((abs(x) for x in (lower, upper) if abs(x) < 1e6), default=0.0) > _RADIANS:  # SDF writes 1e16 for none
        out.append(f"{name}: limits of {lower:g} to {upper:g} rad are more than two turns: are they in degrees?")
    return out
