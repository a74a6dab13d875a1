"""A robot's description as arrays, read off Drake's plant, which stays the only parser of SDF."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import Box, Cylinder, GeometryId, SceneGraphInspector, Shape, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    ForceElementIndex,
    Joint,
    ModelInstanceIndex,
    RevoluteJoint,
    RevoluteSpring,
    RigidBody,
    SpatialInertia,
    UniformGravityFieldElement,
    UnitInertia,
    WeldJoint,
)
from pydrake.planning import RobotDiagramBuilder

from workbench.robot import ConfigureParser, RobotModel
from workbench.simulation.compiled.arrays import BOX, CYLINDER, OTHER, Array, Ints, Tree
from workbench.simulation.compiled.forest import groups, ways
from workbench.simulation.contact import SelectFeet

_VISUAL = re.compile(r"<visual\b[^>]*/>|<visual\b[^>]*>.*?</visual>", re.DOTALL)


class NotCoveredError(Exception):
    """The compiled station does not know something about this robot; the text says what."""


@dataclass(frozen=True)
class ShapeTable:
    """Collision shapes as in `arrays.Shapes`, with the materials of their own: link, stiffness, dissipation and friction, None
    where the description has none."""

    body: Ints
    p: Array
    R: Array
    half: Array
    radius: Array
    solid: Ints
    link: tuple[str, ...]
    stiffness: tuple[float | None, ...]
    dissipation: tuple[float | None, ...]
    friction: tuple[float | None, ...]
    may_touch: np.ndarray


@dataclass(frozen=True)
class LinkWeight:
    """A link, the body (-1: the root) that it is part of, its pose there, and its inertia about that body's origin, in its axes.
    """

    link: str
    body: int
    X: RigidTransform
    M: SpatialInertia


@dataclass(frozen=True)
class Tables:
    """The robot apart from servos, floor and step. joints: names, as the arrays number them. tree: as the description has it,
    without servos' friction, gravity and pull. X_WBase: pose of a fixed base link in W. links: their inertias. derived: results
    that other modules compute from these tables and keep."""

    joints: tuple[str, ...]
    tree: Tree
    X_WBase: RigidTransform
    shapes: ShapeTable
    links: tuple[LinkWeight, ...]
    derived: dict[str, object] = field(default_factory=dict)


def read_tables(model: RobotModel, description: str | None, free: bool) -> Tables:
    """Of a description (SDF text; None: the model's file) on a free or held base; NotCoveredError names the unsupported part."""
    builder = RobotDiagramBuilder(time_step=1e-3)
    plant, parser = builder.plant(), builder.parser()
    ConfigureParser(parser)
    if description is not None:
        instances = parser.AddModelsFromString(_without_visuals(description), "sdf")
    else:
        instances = parser.AddModels(str(model.path))
    if len(instances) != 1:
        raise NotCoveredError(f"{len(instances)} models in one description")
    SelectFeet(plant, builder.scene_graph(), instances[0], "point", 1e6)
    if not free and not model.kinematics.fixed_to_world:
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(model.base, instances[0]), RigidTransform([0, 0, 1.0]))
    plant.Finalize()
    return _Reader(plant, builder.scene_graph().model_inspector(), instances[0], model, free).tables()


def _without_visuals(text: str) -> str:
    """The SDF, as ElementTree writes it, without its visuals, whose meshes take long to load."""
    return _VISUAL.sub("", text)


class _Reader:
    """One finalized plant, read."""

    def __init__(self, plant: MultibodyPlant, inspector: SceneGraphInspector, instance: ModelInstanceIndex, model: RobotModel,
                 free: bool) -> None:
        self.plant, self.inspector, self.instance = plant, inspector, instance
        self.free = free
        self.base: RigidBody = plant.GetBodyByName(model.base, instance)
        joints = [plant.get_joint(j) for j in plant.GetJointIndices()]
        self.turning: list[RevoluteJoint] = sorted(
            (j for j in joints if isinstance(j, RevoluteJoint)), key=lambda j: j.velocity_start())
        self.welds: list[Joint] = [j for j in joints if isinstance(j, WeldJoint)]
        self._check(joints)
        self.number = {int(j.child_body().index()): i for i, j in enumerate(self.turning)}
        self.anchors = self._anchors()

    def _check(self, joints: list[Joint]) -> None:
        other = [j for j in joints if not isinstance(j, (RevoluteJoint, WeldJoint)) and j.num_velocities() != 6]
        if other:
            raise NotCoveredError(f"joint '{other[0].name()}' is neither revolute nor fixed")
        if self.free != bool(self.base.is_floating_base_body()) or sum(j.num_velocities() == 6 for j in joints) > int(self.free):
            raise NotCoveredError(f"the floating link is not '{self.base.name()}' alone")
        if self.plant.num_velocities() != len(self.turning) + 6 * self.free:
            raise NotCoveredError("more turns than revolute joints")
        if self.plant.num_constraints():
            raise NotCoveredError("constraints between links")
        for k in range(self.plant.num_force_elements()):
            if not isinstance(self.plant.get_force_element(ForceElementIndex(k)), (UniformGravityFieldElement, RevoluteSpring)):
                raise NotCoveredError("a force element that is no spring of a joint")

    def _anchors(self) -> dict[int, tuple[int, RigidTransform]]:
        """By link: the body it is part of (-1: the root) and its pose in that body's frame."""
        root = self.base if self.free else self.plant.world_body()
        found = {int(root.index()): (-1, RigidTransform())}
        left = [*self.turning, *self.welds]
        while left:
            ready = [j for j in left if int(j.parent_body().index()) in found]
            if not ready:
                raise NotCoveredError("links that hang on the base against the direction of a joint")
            for j in ready:
                left.remove(j)
                on, X = found[int(j.parent_body().index())]
                child = int(j.child_body().index())
                X_MC = j.frame_on_child().GetFixedPoseInBodyFrame().inverse()
                if isinstance(j, RevoluteJoint):
                    found[child] = (self.number[child], X_MC)
                else:
                    found[child] = (on, X @ j.frame_on_parent().GetFixedPoseInBodyFrame() @ j.X_FM() @ X_MC)
        return found

    def tables(self) -> Tables:
        n, o = len(self.turning), 6 if self.free else 0
        parent, R, p, axis = np.empty(n, np.int64), np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
        on_root = RigidTransform() if self.free else RigidTransform(-self._X_WBase().translation())
        for i, j in enumerate(self.turning):
            parent[i], X_AP = self.anchors[int(j.parent_body().index())]
            X = X_AP @ j.frame_on_parent().GetFixedPoseInBodyFrame()
            X = on_root @ X if parent[i] < 0 else X
            R[i], p[i], axis[i] = X.rotation().matrix(), X.translation(), j.revolute_axis()
        path = np.concatenate([np.arange(-1, o - 1, dtype=np.int64), np.where(parent >= 0, parent + o, o - 1)])
        links = self._links()
        mass, com, inertia = weigh(links, n)
        stiffness, rest = self._springs()
        tree = Tree(
            free=self.free, parent=parent, carrier=np.where(parent >= 0, parent, n).astype(np.uint32), path=path, **ways(path, o),
            group=groups(path), R=R, p=p, axis=axis, mass=mass, com=com, inertia=inertia, armature=self._armature(),
            damping=np.array([j.default_damping() for j in self.turning]), stiffness=stiffness, rest=rest,
            lower=np.array([j.position_lower_limit() for j in self.turning]),
            upper=np.array([j.position_upper_limit() for j in self.turning]), brake=np.zeros(n), brake_gain=np.zeros(n),
            gravity=np.zeros(3), pull=np.zeros(3))
        return Tables(joints=tuple(j.name() for j in self.turning), tree=tree, X_WBase=self._X_WBase(),
                      shapes=self._shapes(n, on_root), links=links)

    def _X_WBase(self) -> RigidTransform:
        """Of a held base; the origin for a free one."""
        if self.free:
            return RigidTransform()
        on, X = self.anchors[int(self.base.index())]
        if on >= 0:
            raise NotCoveredError(f"the base '{self.base.name()}' turns against the world")
        return X

    def _links(self) -> tuple[LinkWeight, ...]:
        found = []
        for index in self.plant.GetBodyIndices(self.instance):
            on, X = self.anchors[int(index)]
            link = self.plant.get_body(index)
            found.append(LinkWeight(link.name(), on, X, carried(link.default_spatial_inertia(), X)))
        return tuple(found)

    def _armature(self) -> Array:
        """Reflected inertia of joints by the description; servos' replace it."""
        out = np.zeros(len(self.turning))
        for k in self.plant.GetJointActuatorIndices():
            actuator = self.plant.get_joint_actuator(k)
            out[self.number[int(actuator.joint().child_body().index())]] = (
                actuator.default_rotor_inertia() * actuator.default_gear_ratio() ** 2)
        return out

    def _springs(self) -> tuple[Array, Array]:
        stiffness, rest = np.zeros(len(self.turning)), np.zeros(len(self.turning))
        for k in range(self.plant.num_force_elements()):
            spring = self.plant.get_force_element(ForceElementIndex(k))
            if isinstance(spring, RevoluteSpring):
                i = self.number[int(spring.joint().child_body().index())]
                if stiffness[i]:
                    raise NotCoveredError(f"two springs across '{self.turning[i].name()}'")
                stiffness[i], rest[i] = spring.default_stiffness(), spring.default_nominal_angle()
        return stiffness, rest

    def _shapes(self, n: int, on_root: RigidTransform) -> ShapeTable:
        links = {int(b.index()): b for b in (self.plant.get_body(i) for i in self.plant.GetBodyIndices(self.instance))}
        found: list[tuple[int, RigidTransform, Array, Shape, str, GeometryId]] = []
        for index, link in links.items():
            on, X = self.anchors[index]
            X = on_root @ X if on < 0 else X
            for g in self.plant.GetCollisionGeometriesForBody(link):
                if self.inspector.GetProximityProperties(g) is None:
                    continue
                box, shape = self.inspector.GetObbInGeometryFrame(g), self.inspector.GetShape(g)
                if box is None:
                    raise NotCoveredError(f"shape '{self.inspector.GetName(g)}' has no end")
                X_BBox = X @ self.inspector.GetPoseInFrame(g) @ box.pose()
                found.append((on if on >= 0 else n, X_BBox, box.half_width(), shape, link.name(), g))
        ids = [f[5] for f in found]
        body = np.array([f[0] for f in found], dtype=np.int64)
        may = np.array([[a != b and body[i] != body[k] and not self.inspector.CollisionFiltered(a, b) for k, b in enumerate(ids)]
                        for i, a in enumerate(ids)], dtype=bool).reshape(len(ids), len(ids))
        return ShapeTable(
            body=body, p=_rows([f[1].translation() for f in found], 3), R=_rows([f[1].rotation().matrix() for f in found], 3, 3),
            half=_rows([f[2] for f in found], 3),
            radius=np.array([f[3].radius() if isinstance(f[3], Sphere) else 0.0 for f in found], dtype=float),
            solid=np.array([BOX if isinstance(f[3], Box) else CYLINDER if isinstance(f[3], Cylinder) else OTHER for f in found],
                           dtype=np.int64), link=tuple(f[4] for f in found),
            stiffness=tuple(self._material(g, "point_contact_stiffness") for g in ids),
            dissipation=tuple(self._material(g, "hunt_crossley_dissipation") for g in ids),
            friction=tuple(self._friction(g) for g in ids), may_touch=may)

    def _material(self, g: GeometryId, name: str) -> float | None:
        properties = self.inspector.GetProximityProperties(g)
        return float(properties.GetProperty("material", name)) if properties.HasProperty("material", name) else None

    def _friction(self, g: GeometryId) -> float | None:
        properties = self.inspector.GetProximityProperties(g)
        if not properties.HasProperty("material", "coulomb_friction"):
            return None
        return float(properties.GetProperty("material", "coulomb_friction").dynamic_friction())


def _rows(values: list[Array], *shape: int) -> Array:
    return np.ascontiguousarray(np.array(values, dtype=float).reshape(len(values), *shape))


def carried(M: SpatialInertia, X: RigidTransform) -> SpatialInertia:
    """A link's inertia about its own origin as one about the origin of the body in which its pose is X."""
    return M.ReExpress(X.rotation()).Shift(-X.translation())


def weigh(links: Sequence[LinkWeight], n: int) -> tuple[Array, Array, Array]:
    """Mass, centre and inertia of each of n bodies and the root, its last, of all links that are part of it."""
    sums: list[SpatialInertia] = [SpatialInertia(0.0, np.zeros(3), UnitInertia(0.0, 0.0, 0.0)) for _ in range(n + 1)]
    for link in links:
        sums[link.body] = link.M if sums[link.body].get_mass() == 0.0 else _sum(sums[link.body], link.M)
    mass, com, inertia = np.array([M.get_mass() for M in sums]), np.array([M.get_com() for M in sums]), np.empty((n + 1, 6))
    for i, M in enumerate(sums):
        about = M.Shift(M.get_com()).CalcRotationalInertia()
        inertia[i] = np.concatenate([about.get_moments(), about.get_products()])
    return mass, com, inertia


def _sum(a: SpatialInertia, b: SpatialInertia) -> SpatialInertia:
    a += b
    return a
