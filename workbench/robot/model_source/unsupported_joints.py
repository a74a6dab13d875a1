"""Joints of an SDF that Drake supports and the workbench does not, rewritten: joints on the world, and coupled joints."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement


def stand_on_world(sdf: Element) -> list[str]:
    """Inserts a massless link, fixed to the world, as the parent of each movable joint whose parent is the world, such as a test
    rig's pendulum: the root of a robot is a link. Returns a line for each model changed."""
    said = []
    for model in sdf.iter("model"):
        on_world = [j for j in model.findall("joint") if (j.findtext("parent") or "").strip() == "world"]
        moved = [j for j in on_world if j.get("type") != "fixed"]
        if not moved:
            continue
        taken = {e.get("name") for e in model}
        name = next(n for n in ("stand", *(f"stand_{k}" for k in range(2, len(taken) + 3))) if n not in taken)
        inertial = SubElement(SubElement(model, "link", {"name": name}), "inertial")
        SubElement(inertial, "mass").text = "0"
        inertia = SubElement(inertial, "inertia")
        for moment in ("ixx", "iyy", "izz"):
            SubElement(inertia, moment).text = "0"
        mount = SubElement(model, "joint", {"name": f"{name}_to_world", "type": "fixed"})
        SubElement(mount, "parent").text, SubElement(mount, "child").text = "world", name
        for joint in moved:
            parent = joint.find("parent")
            assert parent is not None  # its text is "world"
            parent.text = name
        names = ", ".join(j.get("name") or "" for j in moved)
        said.append(f"joint {names} moves against the world: a link '{name}', fixed to the world, is put between")
    return said


def without_mimics(sdf: Element) -> list[str]:
    """Removes the couplings between joints, which servos do not have; returns a line for each."""
    said = []
    for joint in sdf.iter("joint"):
        for axis in (*joint.findall("axis"), *joint.findall("axis2")):
            for mimic in axis.findall("mimic"):
                axis.remove(mimic)
                said.append(mimics(joint.get("name"), mimic.get("joint")))
    return said


def mimics(joint: str | None, other: str | None) -> str:
    """The line about a joint that its file couples to another."""
    return f"joint '{joint}' mimics '{other}'; here it is a joint of its own, with a servo"
