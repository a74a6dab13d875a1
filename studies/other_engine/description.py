"""Links, joints and contact shapes of a robot as plain data, read by Drake's parser (not its dynamics)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Box, Role, SceneGraph, SceneGraphInspector, Sphere
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from workbench.files import InputError
from workbench.robot import ConfigureParser, Ground, Kinematics
from workbench.types import Array


@dataclass(frozen=True)
class ContactShape:
    """A sphere or box: centre p (3,) [m] and R (3, 3) in its link's frame; half: half its extents along its own axes (3,)
    [m], of a sphere three times the radius; friction, stiffness [N/m] and Hunt-Crossley dissipation [s/m], NaN where the
    file does not say."""

    kind: str
    p: Array
    R: Array
    half: Array
    friction: float
    stiffness: float
    dissipation: float
    pair_friction: float = math.nan
    """Of foot and ground together, where it is known; NaN: what foot and ground say."""
    pair_stiffness: float = math.nan
    """Likewise [N/m]."""

    def bottom(self, p_WL: Array, R_WL: Array) -> float:
        """Height of its lowest point where its link is at p_WL (3,), R_WL (3, 3) [m]."""
        up = (R_WL @ self.R)[2]
        reach = self.half[0] if self.kind == "sphere" else float(np.abs(up) @ self.half)
        return float((p_WL + R_WL @ self.p)[2] - reach)


@dataclass(frozen=True)
class SeriesJoint:
    """A hinge that no servo turns, between a servo and its link, through the joint's anchor: axis (3,) in the link's frame;
    half: play to each side [rad], infinite where it is free; stiffness [N m/rad] and damping [N m s/rad]."""

    name: str
    axis: Array
    half: float
    stiffness: float
    damping: float


@dataclass(frozen=True)
class Surroundings:
    """The robot's surroundings. friction: of every foot, None to use `ground`; gravity (3,) [m/s²] and tether (3,) [N], a steady
    force on the root link's origin, in the world; step: x [m] from which on the floor is higher, and its height [m]."""

    ground: Ground
    friction: float | None = None
    gravity: Array = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    tether: Array = field(default_factory=lambda: np.zeros(3))
    step: tuple[float, float] | None = None


@dataclass(frozen=True)
class LinkPart:
    """A link L and the joint that carries it, if any.

    mass [kg], com (3,) [m] and inertia (3, 3) [kg m²] about the centre of mass, all in L. parent: the parent link; p
    (3,) and R (3, 3): pose in the parent with the joint at zero; anchor (3,) and axis (3,): the joint's place and
    direction in L; lower, upper [rad]: its range, equal if the joint does not move. series: what else it turns on, after
    the servo; spring [N m/rad]: between link and parent, at rest where the joint is at zero.
    """

    name: str
    mass: float
    com: Array
    inertia: Array
    shapes: tuple[ContactShape, ...]
    joint: str = ""
    parent: str = ""
    p: Array = field(default_factory=lambda: np.zeros(3))
    R: Array = field(default_factory=lambda: np.eye(3))
    anchor: Array = field(default_factory=lambda: np.zeros(3))
    axis: Array = field(default_factory=lambda: np.array([0.0, 0, 1]))
    lower: float = 0.0
    upper: float = 0.0
    series: tuple[SeriesJoint, ...] = ()
    spring: float = 0.0


@dataclass(frozen=True)
class Description:
    """A robot: its links, parents before children, and the moving joints in alphabetical order."""

    links: tuple[LinkPart, ...]
    joints: tuple[str, ...]

    @property
    def root(self) -> LinkPart:
        """The link that all others hang on."""
        return self.links[0]

    def link(self, name: str) -> LinkPart:
        """A link by its name; ValueError where there is none."""
        for link in self.links:
            if link.name == name:
                return link
        raise ValueError(f"expected one of {', '.join(l.name for l in self.links)}, got the link '{name}'")

    def child_of(self, joint: str) -> LinkPart:
        """The link that a joint carries; ValueError where there is none."""
        for link in self.links:
            if link.joint == joint:
                return link
        raise ValueError(f"expected one of {', '.join(self.joints)}, got the joint '{joint}'")

    def with_link(self, changed: LinkPart) -> Description:
        """The same with the link of that name replaced."""
        return Description(tuple(changed if l.name == changed.name else l for l in self.links), self.joints)

    def lowest(self) -> float:
        """Height of the lowest point of the contact shapes in the root's frame, joints at zero [m]; 0 without shapes."""
        poses = {self.root.name: (np.zeros(3), np.eye(3))}
        for link in self.links[1:]:
            p, R = poses[link.parent]
            poses[link.name] = (p + R @ link.p, R @ link.R)
        return min((s.bottom(*poses[link.name]) for link in self.links for s in link.shapes), default=0.0)


def describe(path: str | Path) -> Description:
    """Reads an SDF or URDF of revolute and fixed joints; InputError where Drake cannot, or where a link has no mass.

    Spheres and boxes are the contact shapes that this engine knows; meshes (a hydroelastic foot beside its spheres) are
    left out.
    """
    kinematics = Kinematics.from_file(Path(path))
    plant, scene_graph = MultibodyPlant(0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    parser = Parser(plant)
    ConfigureParser(parser)
    (instance,) = parser.AddModels(Path(path))
    plant.Finalize()
    inspector = scene_graph.model_inspector()
    links = []
    for name in kinematics.links:
        body = plant.GetBodyByName(name, instance)
        mass, com, inertia = _inertial(body)
        if mass <= 0:
            raise InputError(path, f"link '{name}': expected a positive mass")
        shapes = _shapes(plant, inspector, body)
        joint = kinematics.parent_joint[name]
        if joint is None:
            links.append(LinkPart(name, mass, com, inertia, shapes))
            continue
        f = kinematics.frames[joint]
        links.append(LinkPart(
            name, mass, com, inertia, shapes, joint=joint, parent=f.parent, p=f.X_PF_p + f.X_PF_R @ f.X_MB_p,
            R=f.X_PF_R @ f.X_MB_R, anchor=f.p_BM, axis=f.axis_B, lower=f.lower, upper=f.upper))
    return Description(tuple(links), kinematics.joints)


def _inertial(body: RigidBody) -> tuple[float, Array, Array]:
    spatial = body.default_spatial_inertia()
    mass, com = float(spatial.get_mass()), np.asarray(spatial.get_com(), dtype=float)
    about_origin = np.asarray(spatial.get_unit_inertia().CopyToFullMatrix3(), dtype=float)
    return mass, com, mass * (about_origin - np.dot(com, com) * np.eye(3) + np.outer(com, com))


def _shapes(plant: MultibodyPlant, inspector: SceneGraphInspector, body: RigidBody) -> tuple[ContactShape, ...]:
    out = []
    for geometry in inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(body.index()), Role.kProximity):
        shape, properties = inspector.GetShape(geometry), inspector.GetProximityProperties(geometry)
        if isinstance(shape, Sphere):
            kind, half = "sphere", np.full(3, shape.radius())
        elif isinstance(shape, Box):
            kind, half = "box", np.asarray(shape.size(), dtype=float) / 2
        else:
            continue
        rubbed = properties.HasProperty("material", "coulomb_friction")
        stiffness: Any = properties.GetPropertyOrDefault("material", "point_contact_stiffness", math.nan)
        dissipation: Any = properties.GetPropertyOrDefault("material", "hunt_crossley_dissipation", math.nan)
        X_LG = inspector.GetPoseInFrame(geometry)
        out.append(ContactShape(
            kind, np.asarray(X_LG.translation()), np.asarray(X_LG.rotation().matrix()), half,
            friction=properties.GetProperty("material", "coulomb_friction").dynamic_friction() if rubbed else math.nan,
            stiffness=float(stiffness),
            dissipation=float(dissipation),
        ))
    return tuple(out)
