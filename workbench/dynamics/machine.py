"""The robot's masses and feet: its motion without contact, and the effect of contact forces on its joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box, Capsule, Cylinder, SceneGraph, SceneGraphInspector, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

from workbench.dynamics.trajectory import RobotTrajectory
from workbench.effects.apply import physics_of, resolve
from workbench.files import InputError
from workbench.recording import quaternions
from workbench.robot import GRAVITY, ConfigureParser, RobotModel
from workbench.robot.kinematics import cross, rotation_about
from workbench.robot.model_source.checks import quiet_drake
from workbench.types import Array

DEFAULT_FRICTION = 0.5
"""Where neither the model's ground nor the SDF says one: the thesis's kinetic coefficient (section 6.9)."""


@dataclass(frozen=True)
class FootPoints:
    """The C places where the feet can touch: spheres fixed to links (radius 0: corners).

    feet: names, a foot by its knee's joint. foot: (C,) index into feet. links: (C) names. p_LS: (C, 3) centres in the
    link's frame [m]. radius: (C,) [m]. friction: (C,) as the SDF has it, NaN where it has none.
    """

    feet: tuple[str, ...]
    foot: NDArray[np.int_]
    links: tuple[str, ...]
    p_LS: Array
    radius: Array
    friction: Array


class Machine:
    """A model's rigid bodies on a base that floats, in a continuous Drake plant that is built once.

    Friction and reflected inertia of the servos, and those in the SDF, are left out: torques are those applied to the links.
    Of a model's effects those that change masses are included; left_out names the others.
    """

    def __init__(self, model: RobotModel) -> None:
        self.model, self.joints = model, model.joints
        model.check_base(floating=False)
        kinematics = model.kinematics
        if model.base != kinematics.root:
            raise InputError(model.description, f"base: expected the root of the tree, '{kinematics.root}', got '{model.base}'")
        scene_graph = SceneGraph()
        self._plant = plant = MultibodyPlant(0.0)
        plant.RegisterAsSourceForSceneGraph(scene_graph)
        parser = Parser(plant)
        ConfigureParser(parser)
        loaded = model.with_effects([spec for effect, spec, _ in resolve(model) if effect.layer == "inertia"])
        self.left_out = tuple(spec.effect for spec in model.effects if spec not in loaded.effects)
        description = physics_of(loaded).description
        with quiet_drake():
            if description is None:
                parser.AddModels(str(model.path))
            else:
                parser.AddModelsFromString(description, "sdf")
        self.mount = _unmount(plant, model.base)
        for index in plant.GetJointIndices():
            joint = plant.get_mutable_joint(index)
            joint.set_default_damping_vector(np.zeros(joint.num_velocities()))
        for index in plant.GetJointActuatorIndices():
            plant.get_mutable_joint_actuator(index).set_default_rotor_inertia(0.0)
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -GRAVITY])
        plant.Finalize()
        self.gravity = np.array([0.0, 0.0, -GRAVITY])
        self._context: Any = plant.CreateDefaultContext()
        self._forces = MultibodyForces(plant)
        body = plant.GetBodyByName(model.base)
        self._base_q, base_v = body.floating_positions_start(), body.floating_velocities_start_in_v()
        moving = [plant.GetJointByName(j) for j in self.joints]
        self._q_at = np.array([j.position_start() for j in moving], dtype=int)
        self._v_at = np.array([base_v + i for i in range(6)] + [j.velocity_start() for j in moving], dtype=int)
        self.mass = float(plant.CalcTotalMass(self._context))
        self.points = _foot_points(plant, scene_graph.model_inspector(), model)

    def demand(self, trajectory: RobotTrajectory) -> tuple[Array, Array]:
        """What must act on the base, (N, 6) [moment about B's origin N m, force N] in W, and on the joints, (N, n) [N m], for
        this motion of all joints, in the model's order, if nothing touches the robot (Drake); NaN at gaps."""
        plant, context, forces = self._plant, self._context, self._forces
        N = len(trajectory.time)
        q = np.tile(plant.GetPositions(context), (N, 1))
        q[:, self._base_q:self._base_q + 4], q[:, self._base_q + 4:self._base_q + 7] = trajectory.quat_WB, trajectory.p_WB
        q[:, self._q_at] = trajectory.q
        v, a = np.zeros((2, N, plant.num_velocities()))
        v[:, self._v_at] = np.hstack([trajectory.V_WB, trajectory.v])
        a[:, self._v_at] = np.hstack([trajectory.A_WB, trajectory.a])
        state = np.hstack([q, v])
        out = np.full((N, 6 + len(self.joints)), np.nan)
        for i in np.flatnonzero(np.isfinite(state).all(axis=1) & np.isfinite(a).all(axis=1)):
            plant.SetPositionsAndVelocities(context, state[i])
            plant.CalcForceElementsContribution(context, forces)
            out[i] = plant.CalcInverseDynamics(context, a[i], forces)[self._v_at]
        return out[:, :6], out[:, 6:]

    def places(self, trajectory: RobotTrajectory) -> Array:
        """Lowest points of the feet's spheres in W: (N, C, 3) [m]."""
        R_WB = quaternions.matrix(trajectory.quat_WB)
        poses = self.model.kinematics.forward(trajectory.q, self.joints)
        points = self.points
        centres = np.empty((len(trajectory.time), len(points.links), 3))
        for c, (link, p) in enumerate(zip(points.links, points.p_LS)):
            p_BL, R_BL = poses[link]
            centres[:, c] = trajectory.p_WB + np.einsum("nij,nj->ni", R_WB, p_BL + R_BL @ p)
        centres[:, :, 2] -= points.radius
        return centres

    def velocities(self, trajectory: RobotTrajectory, places: Array) -> Array:
        """Velocities in W (N, C, 3) [m/s] of the links' material at the feet's places (N, C, 3) [m]."""
        omega, v = trajectory.V_WB[:, None, :3], trajectory.V_WB[:, None, 3:]
        out = v + cross(omega, places - trajectory.p_WB[:, None])
        for k, carried, origin, axis in self._axes(trajectory):
            turning = (axis * trajectory.v[:, k, None])[:, None]
            out[:, carried] += cross(turning, places[:, carried] - origin[:, None])
        return np.asarray(out)

    def torque_of(self, trajectory: RobotTrajectory, places: Array, forces: Array) -> Array:
        """Joint torques (N, n) [N m] that contact forces (N, C, 3) [N] in W at places (N, C, 3) [m] amount to: J' f."""
        out = np.zeros((len(trajectory.time), len(self.joints)))
        for k, carried, origin, axis in self._axes(trajectory):
            moment = cross(places[:, carried] - origin[:, None], forces[:, carried]).sum(axis=1)
            out[:, k] = np.sum(axis * moment, axis=1)
        return out

    def _axes(self, trajectory: RobotTrajectory) -> Iterator[tuple[int, list[int], Array, Array]]:
        """Joints under which there are feet: column, indices of the places they carry, origin (N, 3) [m] and axis (N, 3) in W."""
        R_WB = quaternions.matrix(trajectory.quat_WB)
        kinematics = self.model.kinematics
        poses = kinematics.forward(trajectory.q, self.joints)
        for k, joint in enumerate(self.joints):
            carried = [c for c, link in enumerate(self.points.links) if joint in kinematics.chain(link)]
            if not carried:
                continue
            frame = kinematics.frames[joint]
            p_BL, R_BL = poses[frame.child]
            origin = trajectory.p_WB + np.einsum("nij,nj->ni", R_WB, p_BL + R_BL @ frame.p_BM)
            yield k, carried, origin, np.einsum("nij,nj->ni", R_WB, R_BL @ frame.axis_B)


def _unmount(plant: MultibodyPlant, base: str) -> tuple[Array, Array]:
    """Frees a base that the SDF welds to the world, so that the mount's wrench is seen; how it was mounted: p_WB [m], quat_WB."""
    X_WB = RigidTransform()
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        if joint.parent_body().index() == plant.world_body().index() and joint.child_body().name() == base:
            X_WB = joint.frame_on_parent().GetFixedPoseInBodyFrame() @ joint.frame_on_child().GetFixedPoseInBodyFrame().inverse()
            plant.RemoveJoint(joint)
            break
    return X_WB.translation(), X_WB.rotation().ToQuaternion().wxyz()


def _foot_points(plant: MultibodyPlant, inspector: SceneGraphInspector, model: RobotModel) -> FootPoints:
    """Contact points of the links that are the model's feet."""
    feet = tuple(model.foot_links.values())
    rows = [(f, *point) for f, link in enumerate(feet) for point in _spheres(plant, inspector, link)]
    table = np.array(rows).reshape(-1, 6)
    foot = table[:, 0].astype(int)
    links = tuple(feet[f] for f in foot)
    return FootPoints(tuple(model.foot_links), foot, links, table[:, 1:4], table[:, 4], table[:, 5])


def _spheres(plant: MultibodyPlant, inspector: SceneGraphInspector, link: str) -> list[tuple[float, ...]]:
    """Rows of x, y, z, radius, friction: a link's spheres if it has any, else what its other shapes rest on."""
    spheres, others = [], []
    for geometry in plant.GetCollisionGeometriesForBody(plant.GetBodyByName(link)):
        shape, X_LG = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
        properties = inspector.GetProximityProperties(geometry)
        friction = (properties.GetProperty("material", "coulomb_friction").static_friction()
                    if properties.HasProperty("material", "coulomb_friction") else np.nan)
        if isinstance(shape, Sphere):
            spheres.append((*X_LG.translation(), shape.radius(), friction))
        else:
            others += [(*(X_LG @ p), radius, friction) for p, radius in _supports(shape, inspector, geometry)]
    return spheres or others


def _supports(shape: Any, inspector: SceneGraphInspector, geometry: Any) -> list[tuple[Array, float]]:
    """Points (with the radius about them) that a convex shape can rest on."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T
    if isinstance(shape, Box):
        return [(p, 0.0) for p in signs * shape.size() / 2]
    if isinstance(shape, Capsule):
        return [(np.array([0, 0, s * shape.length() / 2]), shape.radius()) for s in (-1, 1)]
    if isinstance(shape, Cylinder):
        rim = [rotation_about(np.array([0.0, 0, 1]), np.array([t]))[0][:, 0] * shape.radius() for t in np.arange(8) * np.pi / 4]
        return [(p + np.array([0, 0, s * shape.length() / 2]), 0.0) for p in rim for s in (-1, 1)]
    box = inspector.GetObbInGeometryFrame(geometry)
    return [] if box is None else [(box.pose() @ p, 0.0) for p in signs * box.half_width()]
