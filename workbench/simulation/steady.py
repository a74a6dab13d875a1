"""A walk whose base is reset to the real robot's at intervals.

Walking is chaotic over seconds, not over half a second: a foot that just slips changes the whole rest of a walk. So the
base gets the recorded pose and velocity at given instants, and the joints, which their servos hold, are left unchanged
(multiple shooting; H. G. Bock, Springer Ser. Chem. Phys. 18, 1981).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from pydrake.geometry import GeometryId, SceneGraph, SceneGraphInspector, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from workbench.types import Array

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

BESIDE = np.deg2rad(0.5)
"""Between simulated and recorded tilt of the base [rad], where half of it is taken away: noise of cameras leaves nearly all of
it, and a walk that goes another way nearly none."""


@dataclass(frozen=True)
class BaseStates:
    """States of the base. times: (K,) [s] after the first command; quat: (K, 4) wxyz, its turn since it rested before the first
    command; v, w: (K, 3) [m/s, rad/s] of its origin and its turning. All in the axes of W."""

    times: Array
    quat: Array
    v: Array
    w: Array


@dataclass(frozen=True)
class JointStates:
    """States of the servos of a held robot. times: (K,) [s] after the first command; q, v: (K, n) [rad, rad/s] in the model's
    order of joints, as their own sensors tell them; NaN where unseen, which are left alone."""

    times: Array
    q: Array
    v: Array


class BaseSetter:
    """Resets a free base to the recorded one. Make it while the robot rests before the first command.

    Heading becomes the recorded one; tilt and velocities do in proportion to the tilt error of the robot. The path continues from
    its position, as the floor is the same everywhere. Cameras do not resolve a contact's penetration, so the height is chosen
    such that the lowest point of the robot's shapes is as deep as before."""

    def __init__(self, states: BaseStates, plant: MultibodyPlant, scene_graph: SceneGraph, base: RigidBody, plant_context: Context
                 ) -> None:
        from scipy.spatial.transform import Rotation  # slow to import, and not needed to read a log

        self.states = states
        self._plant, self._base, self._context = plant, base, plant_context
        inspector = scene_graph.model_inspector()
        bodies = plant.GetBodyIndices(base.model_instance())
        shapes = [g for b in bodies for g in plant.GetCollisionGeometriesForBody(plant.get_body(b))]
        self._shapes = [(g, *_corners(inspector, g)) for g in shapes if inspector.GetProximityProperties(g) is not None]
        self._rest = Rotation.from_matrix(plant.GetFreeBodyPose(plant_context, base).rotation().matrix())
        self._turned: list[tuple[float, Array, Rotation]] = []

    def put(self, k: int, time: float) -> None:
        """Puts the base into state number k, at a time [s] of the run."""
        from scipy.spatial.transform import Rotation  # slow to import, and not needed to read a log

        states = self.states
        X_WB = self._plant.GetFreeBodyPose(self._context, self._base)
        V_WB = self._base.EvalSpatialVelocityInWorld(self._context)
        p_WB, R_WB = X_WB.translation(), Rotation.from_matrix(X_WB.rotation().matrix())
        recorded = Rotation.from_quat(states.quat[k], scalar_first=True) * self._rest
        turn = Rotation.from_euler("z", _heading(recorded) - _heading(R_WB))
        self._turned.append((time, p_WB, turn))
        apart = (recorded * (turn * R_WB).inv()).as_rotvec()
        taken = 1.0 - 1.0 / (1.0 + (float(np.linalg.norm(apart)) / BESIDE) ** 4)
        R_WB = Rotation.from_rotvec(taken * apart) * turn * R_WB
        v, w = turn.apply(np.array([V_WB.translational(), V_WB.rotational()]))
        depth = self._lowest()
        self._place(R_WB, p_WB)
        self._place(R_WB, p_WB + np.array([0.0, 0.0, depth - self._lowest()]))
        velocity = SpatialVelocity(w + taken * (states.w[k] - w), v + taken * (states.v[k] - v))
        self._plant.SetFreeBodySpatialVelocity(context=self._context, body=self._base, V_JpJc=velocity)

    def in_one_piece(self, time: Array, p_WB: Array, quat_WB: Array) -> tuple[Array, Array]:
        """A path (N, 3), (N, 4) at run times (N,) with the jumps of heading removed: the gain of the robot is measured from its
        position, and may extend across a jump."""
        from scipy.spatial.transform import Rotation  # slow to import, and not needed to read a log

        p, R = np.array(p_WB), Rotation.from_quat(np.array(quat_WB), scalar_first=True)
        for at, where, turn in reversed(self._turned):
            later = time > at + 1e-9
            p[later] = turn.inv().apply(p[later] - where) + where
            R[later] = turn.inv() * R[later]
        return p, R.as_quat(scalar_first=True)

    def _place(self, R_WB: Rotation, p_WB: Array) -> None:
        self._plant.SetFreeBodyPose(self._context, self._base, RigidTransform(RotationMatrix(R_WB.as_matrix()), p_WB))

    def _lowest(self) -> float:
        """Lowest z of the robot's shapes [m]."""
        query = self._plant.get_geometry_query_input_port().Eval(self._context)
        return min((float((query.GetPoseInWorld(g) @ corners)[2].min()) - radius for g, corners, radius in self._shapes),
                   default=0.0)


def _heading(R_WB: Rotation) -> float:
    forward = R_WB.apply(np.array([1.0, 0.0, 0.0]))
    return float(np.arctan2(forward[1], forward[0]))


def _corners(inspector: SceneGraphInspector, g: GeometryId) -> tuple[Array, float]:
    """Points (3, m) of a shape in its frame and how far it reaches beyond them: a sphere's centre; a box's corners."""
    shape = inspector.GetShape(g)
    if isinstance(shape, Sphere):
        return np.zeros((3, 1)), float(shape.radius())
    box = inspector.GetObbInGeometryFrame(g)
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]).T
    return np.asarray(box.pose() @ (signs * box.half_width()[:, None])), 0.0
