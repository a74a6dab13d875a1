"""Tree of links and joints, and forward kinematics of many configurations at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.files.reading import cached_by_content
from workbench.types import Array


@dataclass(frozen=True)
class JointFrame:
    """A revolute joint: child link turns about `axis` (unit, in the parent's joint frame F) through the joint's origin."""

    name: str
    parent: str
    child: str
    axis: Array
    X_PF_p: Array
    X_PF_R: Array
    X_MB_p: Array
    X_MB_R: Array
    lower: float
    upper: float
    effort: float

    @property
    def p_BM(self) -> Array:
        """Position of the joint, (3,) [m], in its child link's frame B."""
        return -self.X_MB_R.T @ self.X_MB_p

    @property
    def axis_of_parent(self) -> Array:
        """The joint's axis, (3,) unit, in its parent link's frame."""
        return self.X_PF_R @ self.axis

    @property
    def axis_B(self) -> Array:
        """The joint's axis, (3,) unit, in its child link's frame B."""
        return self.X_MB_R.T @ self.axis


@dataclass(frozen=True)
class Kinematics:
    """Links and revolute joints of a robot, in plain arrays. Weld joints are folded into X_PF of the joints after them.

    masses [kg] and centers of mass (3,) [m], in the link's frame, by link.
    """

    path: Path
    root: str
    links: tuple[str, ...]
    joints: tuple[str, ...]
    frames: dict[str, JointFrame]
    parent_joint: dict[str, str | None]
    masses: dict[str, float]
    fixed_to_world: bool
    centers: dict[str, Array] = field(default_factory=dict)

    @staticmethod
    def from_file(path: Path) -> Kinematics:
        """Parses an SDF or URDF; InputError if Drake cannot."""
        return _parse(Path(path))

    @staticmethod
    def from_text(text: str, path: Path) -> Kinematics:
        """Parses an SDF held in memory; `path` is the file it came from, which errors name."""
        return _parse(Path(path), text)

    @property
    def mass(self) -> float:
        """Mass of the whole robot [kg]."""
        return sum(self.masses.values())

    def joint_of(self, link: str) -> str | None:
        """Name of the joint that carries `link`; None for the root."""
        return self.parent_joint[link]

    def ancestors(self, link: str) -> list[str]:
        """Links from the parent of `link` down to the root."""
        out = []
        joint = self.parent_joint[link]
        while joint is not None:
            out.append(self.frames[joint].parent)
            joint = self.parent_joint[out[-1]]
        return out

    def chain(self, link: str) -> list[str]:
        """Joints from the root to `link`."""
        out: list[str] = []
        joint = self.parent_joint[link]
        while joint is not None:
            out.insert(0, joint)
            joint = self.parent_joint[self.frames[joint].parent]
        return out

    def forward(self, q: Array, joints: tuple[str, ...] | None = None) -> dict[str, tuple[Array, Array]]:
        """Poses of all links in the root link's frame: {link: (p (N, 3) [m], R (N, 3, 3))}.

        q: (N, n) [rad], columns named by `joints` (default: all, in self.joints' order); joints not named stay at zero.
        """
        q = np.atleast_2d(np.asarray(q, dtype=float))
        column = {name: i for i, name in enumerate(self.joints if joints is None else joints)}
        n = len(q)
        poses: dict[str, tuple[Array, Array]] = {
            self.root: (np.zeros((n, 3)), np.broadcast_to(np.eye(3), (n, 3, 3)))
        }
        for link in self.links:  # ordered root first
            name = self.parent_joint[link]
            if name is None:
                continue
            f = self.frames[name]
            p, R = poses[f.parent]
            p_F = p + R @ f.X_PF_p
            R_F = _turned(R, f.X_PF_R)
            if name in column:
                R_F = R_F @ rotation_about(f.axis, q[:, column[name]])
            poses[link] = (p_F + R_F @ f.X_MB_p if f.X_MB_p.any() else p_F, _turned(R_F, f.X_MB_R))
        return poses


_ONE = np.eye(3)


def _turned(R: Array, by: Array) -> Array:
    """R (N, 3, 3) times a matrix (3, 3), which is one in most descriptions."""
    return R if np.array_equal(by, _ONE) else R @ by


def rotation_about(axis: Array, angle: Array) -> Array:
    """Rotation matrices (N, 3, 3) about a unit `axis` by `angle` (N,) [rad] (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.asarray(np.eye(3) + s * K + (1 - c) * (K @ K), dtype=float)


def cross(a: Array, b: Array) -> Array:
    """Cross products (..., 3); NumPy's own takes five times as long for few vectors."""
    ax, ay, az, bx, by, bz = *np.moveaxis(a, -1, 0), *np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


@cached_by_content(maxsize=32)
def _parse(path: Path, text: str | None = None) -> Kinematics:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import RevoluteJoint, WeldJoint

    from workbench.files.resources import ConfigureParser
    from workbench.robot.model_source.checks import drake_error, quiet_drake
    from workbench.robot.model_source.prepare import user_file

    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    ConfigureParser(parser)
    source = user_file(path)
    try:
        with quiet_drake():
            instances = parser.AddModels(str(path)) if text is None else parser.AddModelsFromString(text, "sdf")
            plant.Finalize()
    except (RuntimeError, ValueError) as e:
        raise InputError(source, f"Drake cannot read this model: {drake_error(e)}") from None
    if len(instances) != 1:
        raise InputError(source, f"expected one model, found {len(instances)}")
    instance = instances[0]
    names = [plant.get_body(b).name() for b in plant.GetBodyIndices(instance)]
    masses = {plant.get_body(b).name(): plant.get_body(b).default_mass() for b in plant.GetBodyIndices(instance)}
    centers = {plant.get_body(b).name(): plant.get_body(b).default_com() for b in plant.GetBodyIndices(instance)}
    frames: dict[str, JointFrame] = {}
    parent_joint: dict[str, str | None] = {}
    fixed = False
    for index in plant.GetJointIndices(instance):
        joint = plant.get_joint(index)
        parent, child = joint.parent_body().name(), joint.child_body().name()
        if parent == "world" or joint.parent_body().index() == plant.world_body().index():
            fixed = fixed or isinstance(joint, WeldJoint)
            continue
        X_PF, X_BM = joint.frame_on_parent().GetFixedPoseInBodyFrame(), joint.frame_on_child().GetFixedPoseInBodyFrame()
        X_MB = X_BM.inverse()
        common = {"name": joint.name(), "parent": parent, "child": child,
                  "X_PF_p": X_PF.translation(), "X_PF_R": X_PF.rotation().matrix(),
                  "X_MB_p": X_MB.translation(), "X_MB_R": X_MB.rotation().matrix()}
        if isinstance(joint, RevoluteJoint):
            efforts = [a.effort_limit() for a in map(plant.get_joint_actuator, plant.GetJointActuatorIndices(instance))
                       if a.joint().index() == joint.index()]
            frames[joint.name()] = JointFrame(
                axis=joint.revolute_axis(), lower=float(joint.position_lower_limits()[0]),
                upper=float(joint.position_upper_limits()[0]), effort=float(efforts[0]) if efforts else float("inf"), **common)
        elif isinstance(joint, WeldJoint):
            frames[joint.name()] = JointFrame(axis=np.array([0.0, 0, 1]), lower=0.0, upper=0.0, effort=0.0, **common)
        else:
            raise InputError(source, f"joint '{joint.name()}' is {joint.type_name()}; expected revolute or fixed")
        parent_joint[child] = joint.name()
    roots = [n for n in names if n not in parent_joint]
    if len(roots) != 1:
        raise InputError(source, f"expected one tree with one root link, found roots {', '.join(roots) or 'none'}")
    parent_joint[roots[0]] = None
    ordered = [roots[0]]
    while len(ordered) < len(names):  # parents before children
        ordered += [f.child for f in frames.values() if f.parent in ordered and f.child not in ordered]
    movable = tuple(sorted(n for n, f in frames.items() if f.upper > f.lower))
    return Kinematics(path=path, root=roots[0], links=tuple(ordered), joints=movable, frames=frames,
                      parent_joint=parent_joint, masses=masses, fixed_to_world=fixed, centers=centers)
