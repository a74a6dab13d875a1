"""A robot's SDF in two parts: its structure, which Drake parses, and numbers that are written into the tables made of it.

A search plays thousands of robots that differ in a mass, a spring or a gap alone. Drake takes some milliseconds to parse each,
longer than the rollout.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element

LIMITS, DYNAMICS = ("lower", "upper"), ("damping", "spring_stiffness", "spring_reference")
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


@dataclass(frozen=True, eq=False)
class Split:
    """structure: everything but the numbers below. joints: by joint, the texts of LIMITS
    and of DYNAMICS, None where there is none. weights: by link, the texts of its mass, its centre's pose and its MOMENTS.
    inertials: by link, where these were read."""

    structure: tuple[object, ...]
    joints: dict[str, tuple[str | None, ...]]
    weights: dict[str, tuple[str | None, ...]]
    inertials: dict[str, Element]

    def says_the_same(self, other: Split) -> bool:
        """Whether numbers, too, are those of another of this structure."""
        return self.joints == other.joints and self.weights == other.weights


def split(root: Element) -> Split:
    """Of the root of an SDF with one <model>."""
    joints: dict[str, tuple[str | None, ...]] = {}
    weights: dict[str, tuple[str | None, ...]] = {}
    inertials: dict[str, Element] = {}
    taken: set[int] = set()
    model = root.find("model")
    for e in () if model is None else model:
        name = e.get("name", "")
        if e.tag == "joint" and name not in joints and (axis := e.find("axis")) is not None:
            limit, dynamics = axis.find("limit"), axis.find("dynamics")
            own = [*_children(limit, LIMITS), *_children(dynamics, DYNAMICS)]
            joints[name] = tuple(None if c is None else c.text for c in own)
        elif e.tag == "link" and name not in weights and (inertial := _plain_inertial(e)) is not None:
            own = [inertial.find("mass"), inertial.find("pose"), *_children(inertial.find("inertia"), MOMENTS)]
            weights[name], inertials[name] = tuple(None if c is None else c.text for c in own), inertial
        else:
            continue
        taken |= {id(c) for c in own if c is not None}
    told: list[object] = []
    for e in root.iter():
        if id(e) not in taken:  # with how many children each has, the order says all
            told += (e.tag, len(e), e.text, *e.attrib.items())
    return Split(tuple(told), joints, weights, inertials)


def _children(e: Element | None, tags: tuple[str, ...]) -> list[Element | None]:
    return [None if e is None else e.find(tag) for tag in tags]


def _plain_inertial(link: Element) -> Element | None:
    """A link's only <inertial>, its pose said in the link's own frame."""
    found = link.findall("inertial")
    if len(found) != 1:
        return None
    pose = found[0].find("pose")
    return None if pose is not None and pose.get("relative_to") else found[0]

