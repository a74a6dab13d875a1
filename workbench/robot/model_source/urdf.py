"""URDF written as SDF: the same links, joints and frames, so that whatever changes an SDF changes it too."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from workbench.files import InputError
from workbench.robot.model_source.unsupported_joints import mimics
from workbench.robot.model_source.xml_file import DRAKE

_TYPES = {"revolute": "revolute", "continuous": "revolute", "fixed": "fixed", "prismatic": "prismatic"}
_FREE = "floating"
"""Type of a joint that gives its child six degrees of freedom: a free base, where it hangs on `world`."""
_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


def sdf_of_urdf(root: Element, path: Path) -> tuple[Element, list[str]]:
    """An <sdf> of a <robot>, and a line for each change made on the way.

    A link's frame lies at the joint that carries it; a joint's pose is its origin in its parent. A link without <inertial>: no
    mass. A link called as a joint gets "_link" after its name, as SDF's names are of one kind. InputError names missing or
    unknown elements.
    """
    sdf = Element("sdf", {"version": "1.9"})
    model = SubElement(sdf, "model", {"name": root.get("name") or path.stem})
    joints, links = root.findall("joint"), root.findall("link")
    taken = {j.get("name") for j in joints}
    names = {name: f"{name}_link" if name in taken else name for name in (k.get("name") or "" for k in links)}
    notes = [f"link '{a}' has a joint's name and is called '{b}'" for a, b in names.items() if a != b]
    carrier: dict[str, str] = {}
    for joint in joints:
        child = _end(joint, "child", path)
        if child in carrier:
            raise InputError(path, f"link '{child}' hangs on joints '{carrier[child]}' and '{joint.get('name')}': a kinematic "
                                   "loop; expected a tree")
        carrier[child] = joint.get("name") or ""
    free, left_behind = _free_bases(joints, links, path)
    joints = [j for j in joints if _end(j, "child", path) not in free]
    colours = {m.get("name"): m for m in root.findall("material")}
    for link in links:
        name = link.get("name") or ""
        if name == "world" or name in left_behind:
            continue
        out = SubElement(model, "link", {"name": names[name]})
        if name in carrier and name not in free:
            SubElement(out, "pose", {"relative_to": carrier[name]}).text = "0 0 0 0 0 0"
        _inertial(out, link.find("inertial"))
        for kind in ("visual", "collision"):
            for k, shape in enumerate(link.findall(kind)):
                _shape(out, shape, f"{kind}_{k}", colours, f"link '{name}'", path)
    for joint in joints:
        notes += _joint(model, joint, names, path)
    for group in root.findall(f"{{{DRAKE}}}collision_filter_group"):
        _filter_group(model, group, names)
    return sdf, notes


def _free_bases(joints: list[Element], links: list[Element], path: Path) -> tuple[set[str], set[str]]:
    """Links that a floating joint attaches to the world, or to a root that represents it (odom, map): each is a base that floats
    anyway, wherever the joint puts it. And those roots, which carry nothing else."""
    free, roots = set(), set()
    weigh = {k.get("name") for k in links if k.find("inertial") is not None}
    for joint in joints:
        if joint.get("type") == _FREE:
            parent, child = _end(joint, "parent", path), _end(joint, "child", path)
            if parent in weigh or any(_end(j, "child", path) == parent for j in joints):
                raise InputError(path, f"joint '{joint.get('name')}' is floating, from '{parent}' to '{child}', within the "
                                       f"robot; "
                                       "expected revolute, continuous, prismatic or fixed there")
            free.add(child)
            roots.add(parent)
    others = {_end(j, "parent", path) for j in joints if _end(j, "child", path) not in free}
    return free, {r for r in roots if r not in others}


def _end(joint: Element, tag: str, path: Path) -> str:
    found = joint.find(tag)
    link = None if found is None else found.get("link")
    if not link or not joint.get("name"):
        raise InputError(path, f"joint '{joint.get('name', '')}': expected a name and <{tag} link=...>")
    return link


def _pose(origin: Element | None) -> str:
    return "0 0 0 0 0 0" if origin is None else f"{origin.get('xyz', '0 0 0')} {origin.get('rpy', '0 0 0')}"


def _value(parent: Element, tag: str, text: str | None) -> None:
    if text is not None:
        SubElement(parent, tag).text = text


def _inertial(out: Element, inertial: Element | None) -> None:
    """The inertial of a URDF link; a link without one gets no mass, as SDF's default would be 1 kg."""
    to = SubElement(out, "inertial")
    mass = None if inertial is None else inertial.find("mass")
    moments = None if inertial is None else inertial.find("inertia")
    _value(to, "pose", _pose(None if inertial is None else inertial.find("origin")))
    _value(to, "mass", "0" if mass is None else mass.get("value", "0"))
    inertia = SubElement(to, "inertia")
    weightless = float(to.findtext("mass") or "0") == 0  # Drake would take 1 kg
    for key in _MOMENTS:
        _value(inertia, key, "0" if moments is None or weightless else moments.get(key, "0"))


def _shape(out: Element, shape: Element, name: str, colours: dict[str | None, Element], place: str, path: Path) -> None:
    geometry = shape.find("geometry")
    if geometry is None or not len(geometry):
        raise InputError(path, f"{place}: {shape.tag}: expected a <geometry> with a shape")
    to = SubElement(out, shape.tag, {"name": shape.get("name") or name})
    if out.findall(f"{shape.tag}[@name='{to.get('name')}']")[:-1]:
        to.set("name", name)
    _value(to, "pose", _pose(shape.find("origin")))
    given = geometry[0]
    solid = SubElement(SubElement(to, "geometry"), str(given.tag))
    if given.tag == "mesh":
        _value(solid, "uri", given.get("filename", ""))
        _value(solid, "scale", given.get("scale"))
    else:
        for key in ("size", "radius", "length"):
            _value(solid, key, given.get(key))
    material = shape.find("material")
    if material is not None:
        colour = material.find("color")
        known = colours.get(material.get("name"))
        colour = known.find("color") if colour is None and known is not None else colour
        if colour is not None and colour.get("rgba"):
            _value(SubElement(to, "material"), "diffuse", colour.get("rgba"))
    proximity = shape.find(f"{{{DRAKE}}}proximity_properties")
    if proximity is not None:
        properties = SubElement(to, f"{{{DRAKE}}}proximity_properties")
        for entry in proximity:
            _value(properties, str(entry.tag), entry.get("value", ""))


def _joint(model: Element, joint: Element, names: dict[str, str], path: Path) -> list[str]:
    name, kind = joint.get("name") or "", joint.get("type") or ""
    if kind not in _TYPES:
        raise InputError(path, f"joint '{name}' is {kind or 'of no type'}; expected revolute, continuous, prismatic or fixed (or "
                               "floating, from world to the base)")
    parent, child = _end(joint, "parent", path), _end(joint, "child", path)
    for link in (parent, child):
        if link not in names and link != "world":
            raise InputError(path, f"joint '{name}': no link '{link}'; links: {', '.join(list(names)[:20])}")
    to = SubElement(model, "joint", {"name": name, "type": _TYPES[kind]})
    pose = SubElement(to, "pose")
    pose.text = _pose(joint.find("origin"))
    pose.set("relative_to", "__model__" if parent == "world" else names[parent])
    _value(to, "parent", names.get(parent, parent))
    _value(to, "child", names[child])
    if _TYPES[kind] == "fixed":
        return []
    axis = SubElement(to, "axis")
    given = joint.find("axis")
    if given is not None and not any(float(x) for x in given.get("xyz", "1 0 0").split()):
        raise InputError(path, f"joint '{name}': axis {given.get('xyz')} has no direction; expected one, as 0 1 0")
    _value(axis, "xyz", "1 0 0" if given is None else given.get("xyz", "1 0 0"))
    limit = joint.find("limit")
    if limit is not None:
        bounds = SubElement(axis, "limit")
        for key in ("lower", "upper") if kind != "continuous" else ():
            _value(bounds, key, limit.get(key, "0"))
        for key in ("effort", "velocity"):
            _value(bounds, key, limit.get(key))
    dynamics = joint.find("dynamics")
    if dynamics is not None:
        values = SubElement(axis, "dynamics")
        for key in ("damping", "friction"):
            _value(values, key, dynamics.get(key))
    mimic = joint.find("mimic")
    return [] if mimic is None else [mimics(name, mimic.get("joint"))]


def _filter_group(model: Element, group: Element, names: dict[str, str]) -> None:
    to = SubElement(model, str(group.tag), {"name": group.get("name") or "group"})
    for entry in group:
        name = entry.get("link") or entry.get("name") or ""
        SubElement(to, str(entry.tag)).text = names.get(name, name)
