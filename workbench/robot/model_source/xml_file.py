"""Reads a robot description as an XML tree, safely: bounded sizes, no entities, no circular includes."""

from __future__ import annotations

import io
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from workbench.files import InputError
from workbench.files.numerals import number_of
from workbench.files.reading import read_bytes
from workbench.physical import GROUND

MOST_XML = 32 << 20
"""Largest description [bytes]; a robot of a hundred links has 0.1 MB."""
MOST_DEPTH = 200
"""Deepest nesting of elements; beyond it, a file is damaged or hostile."""
MOST_INCLUDES = 20
"""Files that include each other in a chain; beyond it, Drake's own parser is left to judge."""
DRAKE = "http://drake.mit.edu"

_NUMBERS = {**dict.fromkeys(("mass", "ixx", "iyy", "izz", "ixy", "ixz", "iyz", "lower", "upper", "effort", "velocity", "damping",
                             "spring_stiffness", "spring_reference", "radius", "length", "mu", "mu2"), (1,)),
            "pose": (0, 6, 7), "xyz": (3,), "size": (2, 3), "scale": (3,)}
"""SDF's elements whose text is numbers, and how many (a pose with a quaternion has seven, one that is its frame none; a
plane's size two)."""
_ATTRIBUTES = {"mass": ("value",), "inertia": ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), "origin": ("xyz", "rpy"),
               "axis": ("xyz",), "limit": ("lower", "upper", "effort", "velocity"), "dynamics": ("damping", "friction"),
               "box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",), "capsule": ("radius", "length"),
               "mesh": ("scale",), "color": ("rgba",)}
"""URDF's attributes that are numbers."""
_COUNTS = {"rpy": (3,), "rgba": (4,), "friction": (1,)}
_MATERIAL = {"mu_static": None, "mu_dynamic": None, "point_contact_stiffness": GROUND["stiffness"],
             "hunt_crossley_dissipation": GROUND["dissipation"], "hydroelastic_modulus": None, "relaxation_time": None}
"""Drake's own elements of a shape, each one number, with its range; Drake takes 0 for a text. Of friction the robot is asked, as
a session may replace it."""
_LARGEST, _SMALLEST = 1e12, 1e-300
_ENDLESS = {"lower", "upper", "effort", "velocity"}
"""Those that may be infinite."""

_CONVERTED = {
    "mujoco": ", a MuJoCo model (MJCF): most publish the URDF that it was made of; else convert it with mjcf2urdf or Drake's "
              "Parser and write SDF",
    "COLLADA": ", a mesh (COLLADA): name the robot's URDF or SDF, which names its meshes",
    "launch": ", a launch file of ROS: name the robot description that it loads"}
"""Remedies for models of other kinds, by root element."""


def read_xml(path: Path) -> Element:
    """The root of a description; InputError where it is no whole XML, too large or nested too deep."""
    content = read_bytes(path, MOST_XML)
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content:
        raise InputError(path, "a DOCTYPE or entities; expected a plain description")
    ElementTree.register_namespace("drake", DRAKE)
    try:
        depth, root = 0, None
        for event, element in ElementTree.iterparse(io.BytesIO(_bound_prefix(content)), events=("start", "end")):
            root = element if root is None else root
            depth += 1 if event == "start" else -1
            if depth > MOST_DEPTH:
                raise InputError(path, f"nested deeper than {MOST_DEPTH} levels")
    except (ElementTree.ParseError, ValueError, LookupError) as e:  # LookupError: an unknown encoding
        if not content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<") and b"\0" not in content[:200]:
            raise InputError(path, "no XML; expected a robot as SDF or URDF, or a model.yaml") from None
        raise InputError(path, f"not whole XML in UTF-8, or in the encoding that it says: {e}") from None
    if root is None or root.tag not in ("sdf", "robot"):
        found = "nothing" if root is None else f"<{root.tag[:40]}>"
        how = _CONVERTED.get(root.tag if root is not None else "", "")
        raise InputError(path, f"expected a robot as SDF (<sdf>) or URDF (<robot>), found {found}{how}")
    if b"xmlns:xacro" in content and any(str(e.tag).startswith("{") and "xacro" in str(e.tag) for e in root.iter()):
        raise InputError(path, "holds xacro macros; expected the URDF that `xacro FILE > robot.urdf` makes of it")
    return root


_SIZES = ("size", "radius", "length")
"""Of shapes; in place of others Drake takes 1 m."""


def _bound_prefix(content: bytes) -> bytes:
    """The content with Drake's prefix bound, which Drake itself does not require."""
    if b"drake:" in content and b"xmlns:drake" not in content:
        for tag in (b"<sdf", b"<robot"):
            content = content.replace(tag, tag + f' xmlns:drake="{DRAKE}"'.encode(), 1)
    return content


def check_includes(path: Path, root: Element, seen: tuple[Path, ...] = ()) -> None:
    """InputError if a file includes itself, directly or indirectly."""
    seen = (*seen, path.resolve())
    for include in root.iter("include"):
        uri = (include.findtext("uri") or "").strip()
        if "://" in uri and not uri.startswith("file://"):
            continue
        target = (path.parent / uri.removeprefix("file://")).resolve()
        if target in seen:
            raise InputError(path, f"<include> '{uri}': the model includes itself")
        if target.is_file() and len(seen) < MOST_INCLUDES:
            check_includes(target, read_xml(target), seen)


def check_numbers(path: Path, root: Element) -> None:
    """InputError that names link or joint where a number is none, or is not finite."""
    for owner in root.iter():
        if owner.tag not in ("link", "joint"):
            continue
        for element in owner.iter():
            if root.tag == "sdf" and element.tag in _NUMBERS and len(element) == 0:
                _check(path, owner, str(element.tag), element.text or "")
            if str(element.tag).startswith(f"{{{DRAKE}}}"):
                text = element.text if root.tag == "sdf" else element.get("value")
                _check_material(path, owner, str(element.tag).partition("}")[2], text or "")
            for key in _ATTRIBUTES.get(str(element.tag), ()) if root.tag == "robot" else ():
                if key in element.attrib:
                    _check(path, owner, key if key != "value" else element.tag, element.attrib[key])


def _check_material(path: Path, owner: Element, what: str, text: str) -> None:
    if what not in _MATERIAL:
        return
    _check(path, owner, what, text)
    wanted = _MATERIAL[what]
    problem = None if wanted is None else wanted.problem(number_of(text.strip()))
    if problem is not None:
        raise InputError(path, f"{owner.tag} '{owner.get('name', '')}': {what}: {problem}")


def _check(path: Path, owner: Element, what: str, text: str) -> None:
    place = f"{owner.tag} '{owner.get('name', '')}': {what}"
    words, counts = text.split(), _NUMBERS.get(what) or _COUNTS.get(what, (1,))
    if len(words) not in counts:
        raise InputError(path, f"{place}: expected {' or '.join(map(str, counts))} number(s), found {len(words)}")
    for word in words:
        endless = what in _ENDLESS and word.lower().lstrip("+-") in ("inf", "infinity")
        value = number_of(word)
        bad = value is None or abs(value) > _LARGEST or 0 < abs(value) < _SMALLEST
        if bad and not endless and not (what in _ENDLESS and value is not None):
            raise InputError(path, f"{place}: expected finite numbers of a usual size, found '{word[:40]}'")
        if what in _SIZES and value is not None and value <= 0:
            raise InputError(path, f"{place}: expected a size above 0, found '{word[:40]}'")
