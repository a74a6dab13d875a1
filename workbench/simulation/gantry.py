"""A gantry that moves the base along a given path: three slides and three hinges with stiff implicit controllers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.tree import ModelInstanceIndex, PdControllerGains, PrismaticJoint, RevoluteJoint, SpatialInertia
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

GAINS = PdControllerGains(p=1e6, d=1e4)
"""Stiffness [N/m, N m/rad]: the weight of a 2 kg robot deflects it by 20 micrometres."""
AXES = ("x", "y", "z", "yaw", "pitch", "roll")


def AddGantry(builder: RobotDiagramBuilder, base: str, instance: ModelInstanceIndex) -> None:
    """Hangs link `base` of the model on a gantry "gantry"; its controllers arm once connect_path is called after Finalize."""
    plant = builder.plant()
    gantry = plant.AddModelInstance("gantry")
    parent = plant.world_frame()
    for i, name in enumerate(AXES):
        carriage = plant.AddRigidBody(f"gantry_{name}", gantry, SpatialInertia.Zero()).body_frame()
        kind, axis = (PrismaticJoint, i) if i < 3 else (RevoluteJoint, 5 - i)
        joint = plant.AddJoint(kind(f"gantry_{name}", parent, carriage, np.eye(3)[axis]))
        plant.AddJointActuator(f"gantry_{name}", joint).set_controller_gains(GAINS)
        parent = carriage
    plant.WeldFrames(parent, plant.GetFrameByName(base, instance))


def ConnectPath(builder: RobotDiagramBuilder) -> None:
    """Adds the TrajectorySource "base_path" that the gantry follows; call its UpdateTrajectory before a run."""
    plant = builder.plant()
    hold = PiecewisePolynomial.FirstOrderHold([0.0, 1.0], np.zeros((6, 2)))
    source = builder.builder().AddSystem(TrajectorySource(hold, 1, True))
    source.set_name("base_path")
    builder.builder().Connect(source.get_output_port(),
    plant.get_desired_state_input_port(plant.GetModelInstanceByName("gantry")))


def gantry_coordinates(p_WB: NDArray[np.float64], quat_WB: NDArray[np.float64]) -> NDArray[np.float64]:
    """Base poses (N, 3) [m], (N, 4) wxyz as gantry coordinates (N, 6): x, y, z [m], yaw, pitch, roll [rad]; continuous in
    yaw and roll."""
    from scipy.spatial.transform import Rotation  # slow to import, and not needed to read a log

    angles = np.unwrap(Rotation.from_quat(quat_WB, scalar_first=True).as_euler("ZYX"), axis=0)
    return np.hstack([p_WB, angles])


def base_poses(coordinates: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The inverse: p_WB (N, 3), quat_WB (N, 4) wxyz."""
    from scipy.spatial.transform import Rotation  # slow to import, and not needed to read a log

    return coordinates[:, :3], Rotation.from_euler("ZYX", coordinates[:, 3:]).as_quat(scalar_first=True)
