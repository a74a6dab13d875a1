"""Links, joints and contact shapes of a robot as plain data, read by Drake's parser (not its dynamics)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Role, SceneGraph, SceneGraphInspector, Sphere
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody

from workbench.robot import ConfigureParser, InputError, Kinematics

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FootSphere:
    """A contact sphere: centre (3,) in its link's frame and radius [m]; friction, stiffness [N/m], NaN if unsaid."""

    name: str
    center: Array
    radius: float
    friction: float
    stiffness: float


@dataclass(frozen=True)
class LinkPart:
    """A link L and the joint that carries it, if any.

    mass [kg], com (3,) [m] and inertia (3, 3) [kg m²] about the centre of mass, all in L. parent: the parent link; p
    (3,) and R (3, 3): pose in the parent with the joint at zero; anchor (3,) and axis (3,): the joint's place and
    direction in L; lower, upper [rad]: its range, equal if the joint does not move.
    """

    name: str
    mass: float
    com: Array
    inertia: Array
    spheres: tuple[FootSphere, ...]
    joint: str = ""
    parent: str = ""
    p: Array = field(default_factory=lambda: np.zeros(3))
    R: Array = field(default_factory=lambda: np.eye(3))
    anchor: Array = field(default_factory=lambda: np.zeros(3))
    axis: Array = field(default_factory=lambda: np.array([0.0, 0, 1]))
    lower: float = 0.0
    upper: float = 0.0


@dataclass(frozen=True)
class Description:
    """A robot: its links, parents before children, and the moving joints in alphabetical order."""

    links: tuple[LinkPart, ...]
    joints: tuple[str, ...]

    @property
    def root(self) -> LinkPart:
        """The link that all others hang on."""
        return self.links[0]

    def lowest(self) -> float:
        """Height of the lowest contact sphere's bottom in the root's frame, joints at zero [m]; 0 without spheres."""
        poses = {self.root.name: (np.zeros(3), np.eye(3))}
        for link in self.links[1:]:
            p, R = poses[link.parent]
            poses[link.name] = (p + R @ link.p, R @ link.R)
        bottoms = [
            float((p + R @ s.center)[2]) - s.radius
            for link in self.links
            for p, R in [poses[link.name]]
            for s in link.spheres
        ]
        return min(bottoms, default=0.0)


def describe(path: str | Path) -> Description:
    """Reads an SDF or URDF of revolute and fixed joints; InputError where Drake cannot, or where a link has no mass.

    Spheres are the contact shapes that this engine knows; others (a hydroelastic foot beside its spheres) are left out.
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
        spheres = _spheres(plant, inspector, body)
        joint = kinematics.parent_joint[name]
        if joint is None:
            links.append(LinkPart(name, mass, com, inertia, spheres))
            continue
        f = kinematics.frames[joint]
        R_LM = f.X_MB_R.T
        links.append(LinkPart(
            name, mass, com, inertia, spheres, joint=joint, parent=f.parent, p=f.X_PF_p + f.X_PF_R @ f.X_MB_p,
            R=f.X_PF_R @ f.X_MB_R, anchor=-R_LM @ f.X_MB_p, axis=R_LM @ f.axis, lower=f.lower, upper=f.upper))
    return Description(tuple(links), kinematics.joints)


def _inertial(body: RigidBody) -> tuple[float, Array, Array]:
    spatial = body.default_spatial_inertia()
    mass, com = float(spatial.get_mass()), np.asarray(spatial.get_com(), dtype=float)
    about_origin = np.asarray(spatial.get_unit_inertia().CopyToFullMatrix3(), dtype=float)
    return mass, com, mass * (about_origin - np.dot(com, com) * np.eye(3) + np.outer(com, com))


def _spheres(plant: MultibodyPlant, inspector: SceneGraphInspector, body: RigidBody) -> tuple[FootSphere, ...]:
    out = []
    for geometry in inspector.GetGeometries(plant.GetBodyFrameIdOrThrow(body.index()), Role.kProximity):
        shape, properties = inspector.GetShape(geometry), inspector.GetProximityProperties(geometry)
        if not isinstance(shape, Sphere):
            continue
        friction: Any = properties.GetPropertyOrDefault("material", "coulomb_friction", None)
        stiffness: Any = properties.GetPropertyOrDefault("material", "point_contact_stiffness", math.nan)
        out.append(FootSphere(
            name=inspector.GetName(geometry).split("::")[-1],
            center=inspector.GetPoseInFrame(geometry).translation(),
            radius=shape.radius(),
            friction=math.nan if friction is None else friction.dynamic_friction(),
            stiffness=float(stiffness),
        ))
    return tuple(out)
