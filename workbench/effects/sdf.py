"""Changes to a robot's SDF, as text that any Drake project can load."""

from __future__ import annotations

from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from workbench.cache import Cache
from workbench.effects.sdf_values import format_numbers, numbers, read_inertia, set_child, shift_pose, write_inertia, write_pose
from workbench.files import InputError
from workbench.robot import JointFrame, Kinematics
from workbench.robot.model_source import user_file
from workbench.types import Array

GEAR_MASS, GEAR_INERTIA = 1e-4, 1e-8
"""Mass and inertia of the link between servo and link [kg, kg m^2]: small compared with any robot, large enough for the solver.
The gear's inertia at the joint is the servo's reflected inertia, which stays on the servo's joint."""
SPRING_TIME = 1e-3
"""Ratio of a gear spring's damping to its stiffness [s]. Drake integrates springs explicitly and joint damping implicitly;
together they are stable for any stiffness k on any inertia I up to a step h of twice this: h^2 k/I < 4 + 2 h d/I with
d = k SPRING_TIME. For longer steps the station adds damping."""
PLAY_DAMPING = 5e-4
"""Damping inside a gear's play [N m s/rad]: a link that swings in it comes to rest within seconds, and a servo that moves at
3 rad/s drags it along with only 1.5 mN m."""
DRAKE = "{http://drake.mit.edu}"

KEPT = 64
"""Number of kinematic trees in the cache."""
_kinematics: Cache[Kinematics] = Cache(KEPT)


class SdfRobot:
    """An SDF file in memory; each method changes one thing about the robot. Lengths m, angles rad.

    stages: by servo joint, the joints inserted between its servo and its link, starting at the servo. They have the frame of the
    servo joint; the servo joint keeps its name and is on the servo's side. moved: link lengths differ from the file's. ends: some
    joint was given hard ends.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.source = path, user_file(path)
        ElementTree.register_namespace("drake", "http://drake.mit.edu")
        self.root = deepcopy(_parse(path, path.stat().st_mtime_ns))
        model = self.root.find("model")
        if model is None:
            raise InputError(self.source, "no <model>: effects that change the robot's structure need an SDF file")
        self._model = model
        self.stages: dict[str, tuple[str, ...]] = {}
        self._built: list[object] = [path, path.stat().st_mtime_ns]
        self.moved = self.ends = False
        self._link_of = {j.get("name", ""): j.findtext("child", "").strip() for j in model.findall("joint")}

    def text(self) -> str:
        """The changed SDF, with relative paths made absolute."""
        for uri in self._model.iter("uri"):
            if uri.text and "://" not in uri.text:  # from text without a file, Drake accepts neither relative nor absolute paths
                uri.text = f"file://{(self.path.parent / uri.text.strip()).resolve()}"
        return ElementTree.tostring(self.root, encoding="unicode")

    def kinematics(self) -> Kinematics:
        """Kinematics of the robot as changed so far, except for its masses and the ends of its joints; cached by its changes of
        joints and lengths."""
        return _kinematics.get(tuple(self._built), lambda: Kinematics.from_text(self.text(), self.path))

    def add_play(self, joint: str, gap: float) -> None:
        """The link turns freely by `gap` in total about the joint's axis, half to each side of the servo."""
        if gap > 0:
            self._add_stage(joint, self._joint(joint).find("axis/xyz"), (-gap / 2, gap / 2))

    def add_compliance(self, joint: str, stiffness: float) -> None:
        """A spring [N m/rad] about the joint's axis between servo and link."""
        self._add_stage(joint, self._joint(joint).find("axis/xyz"), None, stiffness)

    def add_loose_mount(self, joint: str, play: float, axis: Array) -> None:
        """The link turns freely by `play` in total about `axis` (3,), in the link's frame, through the joint's origin."""
        frame = self.kinematics().frames[joint]
        across = np.asarray(axis) / np.linalg.norm(axis) if np.any(axis) else np.zeros(3)
        if not np.linalg.norm(np.cross(across, frame.axis_B)) > 0.02:
            raise InputError(self.source, f"loose mount of '{joint}': axis: expected a direction other than the servo's own axis")
        xyz = Element("xyz", {"expressed_in": self._carried_by(joint)})
        xyz.text = format_numbers(across)
        if play > 0:
            self._add_stage(joint, xyz, (-play / 2, play / 2))

    def set_stop(self, joint: str, lower: float, upper: float) -> None:
        """Sets the ends of the servo's joint, unless its present ends are nearer."""
        axis = self._joint(joint).find("axis")
        assert axis is not None  # Drake does not read a revolute joint without one
        limit = axis.find("limit")
        limit = SubElement(axis, "limit") if limit is None else limit
        lower, upper = max(lower, float(limit.findtext("lower", "-inf"))), min(upper, float(limit.findtext("upper", "inf")))
        if not lower < upper:
            raise InputError(self.source, f"stop of '{joint}': expected lower below upper, and both within the joint's own range")
        set_child(limit, "lower", lower)
        set_child(limit, "upper", upper)
        self.ends = True

    def add_parallel_spring(self, joint: str, stiffness: float) -> None:
        """A spring [N m/rad] across the servo's joint, relaxed in neutral, in addition to any spring in the file."""
        axis = self._joint(joint).find("axis")
        assert axis is not None
        dynamics = axis.find("dynamics")
        dynamics = SubElement(axis, "dynamics") if dynamics is None else dynamics
        own, rest = float(dynamics.findtext("spring_stiffness", "0")), float(dynamics.findtext("spring_reference", "0"))
        set_child(dynamics, "spring_stiffness", own + stiffness)
        set_child(dynamics, "spring_reference", own * rest / (own + stiffness) if own else 0.0)

    def add_point_mass(self, link: str, mass: float, position: Array) -> None:
        """A point of `mass` [kg] fixed at `position` (3,) in the link's frame."""
        inertial = self.inertial(link)
        m, center, inertia = read_inertia(inertial)
        both = (m * center + mass * np.asarray(position)) / (m + mass)
        inertia = inertia + _parallel(m, center - both) + _parallel(mass, position - both)
        write_inertia(inertial, m + mass, both, inertia)

    def shift_center(self, link: str, offset: Array) -> None:
        """The link's centre of mass, with the inertia about it, moved by `offset` (3,) in the link's frame."""
        inertial = self.inertial(link)
        m, center, inertia = read_inertia(inertial)
        write_inertia(inertial, m, center + offset, inertia)

    def lengthen(self, link: str, change: float) -> None:
        """Lengthens the link by `change`, from its joint to the next (to the mean of several): the links that it carries move
        along, or the foot if it carries none. The link's inertia is unchanged."""
        k = self.kinematics()
        way = self.way(k, link)
        length = float(np.linalg.norm(way))
        if length < 1e-6 or length + change <= 0:
            raise InputError(self.source, f"length of '{link}': {length:g} m from joint to joint cannot change by {change:g} m")
        following, foot = self._ends(k, link)
        shift = way / length * change
        for shape in foot:
            shift_pose(shape, shift)
        if following:
            self._place_links(k, {f.child for f in following}, link, shift)
        self.moved = True
        self._built.append((link, change))

    def way(self, k: Kinematics, link: str) -> Array:
        """Vector (3,) [m] from a link's joint to the next (to the mean of several, or to the foot of a last link), in the link's
        frame. k: kinematics of this robot."""
        joint = k.parent_joint[link]
        if joint is None:
            raise InputError(self.source, f"length of '{link}': the root link has no joint; expected a link with a parent joint")
        carrier = k.frames[joint]
        following, foot = self._ends(k, link)
        ends = [f.X_PF_p for f in following] or [numbers(s.find("pose"), 6)[:3] for s in foot if s.tag == "collision"]
        if not ends:
            raise InputError(self.source, f"length of '{link}': expected a joint or a collision shape at its end")
        return np.asarray(np.mean(ends, axis=0) - carrier.p_BM, dtype=float)

    def _ends(self, k: Kinematics, link: str) -> tuple[list[JointFrame], list[Element]]:
        """Joints that a link carries; if it carries none, the shapes of its foot."""
        following = [f for f in k.frames.values() if f.parent == link]
        return following, [] if following else self._foot(link)

    def _place_links(self, k: Kinematics, carried: set[str], link: str, shift: Array) -> None:
        """Writes the pose of each link relative to the root, and of each joint relative to its child, so that only the `carried`
        links and their descendants move, by `shift` (3,) in `link`'s frame."""
        poses = k.forward(np.zeros((1, len(k.joints))))
        for name in k.links:
            if name == k.root:
                continue
            p, R = poses[name][0][0], poses[name][1][0]
            if carried & {name, *k.ancestors(name)}:
                p = p + poses[link][1][0] @ shift
            write_pose(self._link(name), p, R, relative_to=k.root)
        for name, f in k.frames.items():
            write_pose(self._joint(name), f.p_BM, f.X_MB_R.T)

    def _foot(self, link: str) -> list[Element]:
        """Shapes of the link's foot: those with "foot" in their names, or else all collision shapes."""
        shapes = [s for s in self._link(link) if s.tag in ("collision", "visual")]
        named = [s for s in shapes if "foot" in s.get("name", "")]
        return named if any(s.tag == "collision" for s in named) else [s for s in shapes if s.tag == "collision"]

    def _add_stage(self, joint: str, xyz: Element | None, limits: tuple[float, float] | None, stiffness: float = 0.0) -> None:
        """Inserts a light link before the joint's link, and a joint without an actuator between the two."""
        before, link = self.stages.get(joint, ()), self._carried_by(joint)
        name = f"{joint}_stage_{len(before) + 1}"
        gear = SubElement(self._model, "link", {"name": f"{name}_gear"})
        SubElement(gear, "pose", {"relative_to": link})
        write_inertia(SubElement(gear, "inertial"), GEAR_MASS, np.zeros(3), GEAR_INERTIA * np.eye(3))
        set_child(self._joint(before[-1] if before else joint), "child", f"{name}_gear")
        stage = SubElement(self._model, "joint", {"name": name, "type": "revolute"})
        SubElement(stage, "pose", {"relative_to": joint})
        set_child(stage, "parent", f"{name}_gear")
        set_child(stage, "child", link)
        axis = SubElement(stage, "axis")
        if xyz is not None:
            axis.append(deepcopy(xyz))
        limit = SubElement(axis, "limit")
        for end, angle in zip(("lower", "upper"), limits or ()):
            set_child(limit, end, angle)
        self.ends |= limits is not None
        set_child(limit, "effort", 0)  # Drake: no actuator
        dynamics = SubElement(axis, "dynamics")
        set_child(dynamics, "damping", stiffness * SPRING_TIME if stiffness else PLAY_DAMPING)
        if stiffness:
            set_child(dynamics, "spring_stiffness", stiffness)
        if not before:
            self._keep_apart(joint)
        self.stages[joint] = (*before, name)
        self._built.append((name, None if xyz is None else ElementTree.tostring(xyz)))

    def _keep_apart(self, joint: str) -> None:
        """Excludes collisions of the two links: Drake excludes only neighbours, and these now have a gear between them."""
        group = SubElement(self._model, f"{DRAKE}collision_filter_group", {"name": f"{joint}_neighbours"})
        for link in (self._joint(joint).findtext("parent", "").strip(), self._carried_by(joint)):
            SubElement(group, f"{DRAKE}member").text = link
        SubElement(group, f"{DRAKE}ignored_collision_filter_group").text = f"{joint}_neighbours"

    def _find(self, tag: str, name: str) -> Element:
        for element in self._model.findall(tag):
            if element.get("name") == name:
                return element
        raise InputError(self.source, f"expected a <{tag}> '{name}' in the model itself, not in a nested one")

    def _joint(self, name: str) -> Element:
        return self._find("joint", name)

    def _carried_by(self, joint: str) -> str:
        """The joint's child link in the file, without inserted stages."""
        self._joint(joint)
        return self._link_of[joint]

    def _link(self, name: str) -> Element:
        return self._find("link", name)

    def inertial(self, link: str) -> Element:
        """The <inertial> of a link; InputError if it has none."""
        inertial = self._link(link).find("inertial")
        if inertial is None:
            raise InputError(self.source, f"link '{link}' has no <inertial> to which mass can be added")
        return inertial


@lru_cache(maxsize=8)
def _parse(path: Path, changed: int) -> Element:
    """The root element of a file; callers must copy it. changed: the file's time of modification, so that a changed file is read
    again."""
    return ElementTree.parse(path).getroot()


def _parallel(mass: float, d: Array) -> Array:
    """Inertia (3, 3) of a point of `mass` at d (3,) (Huygens-Steiner)."""
    return np.asarray(mass * (d @ d * np.eye(3) - np.outer(d, d)))
