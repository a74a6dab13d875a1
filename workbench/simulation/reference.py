"""Connects trajectories, given as plain arrays, to the desired_state ports of Drake's joint PD controllers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RevoluteJoint
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, Multiplexer, TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from workbench.files import InputError
from workbench.robot import RobotModel
from workbench.types import Array


def ConnectReference(
    builder: DiagramBuilder, plant: MultibodyPlant, joints: Sequence[RevoluteJoint], with_velocity: bool
) -> None:
    """Feeds the joints' PD controllers from a TrajectorySource named "joint_reference", with one column for each actuator of
    their model instance (reference_columns); call its UpdateTrajectory before a run."""
    port = plant.get_desired_state_input_port(joints[0].model_instance())
    n = port.size() // 2
    hold = linear_trajectory(np.array([0.0, 1.0]), np.zeros((2, n)))
    source = builder.AddSystem(TrajectorySource(hold, int(with_velocity), True))
    source.set_name("joint_reference")
    if with_velocity:
        builder.Connect(source.get_output_port(), port)
        return
    rest = builder.AddSystem(ConstantVectorSource(np.zeros(n)))
    rest.set_name("zero_velocity_reference")
    stack = builder.AddSystem(Multiplexer([n, n]))
    stack.set_name("desired_state")
    builder.Connect(source.get_output_port(), stack.get_input_port(0))
    builder.Connect(rest.get_output_port(), stack.get_input_port(1))
    builder.Connect(stack.get_output_port(), port)


def reference_columns(plant: MultibodyPlant, model: RobotModel) -> NDArray[np.int_]:
    """For each actuator of the joints' model instance in Drake's order, the column of its joint in `model.joints`."""
    instance = plant.GetJointByName(model.joints[0]).model_instance()
    names = [plant.get_joint_actuator(a).joint().name() for a in plant.GetJointActuatorIndices(instance)]
    for name in names:
        if name not in model.joints:
            raise InputError(model.description, f"joint '{name}' has an actuator but no servo")
    return np.array([model.joints.index(n) for n in names], dtype=int)


def linear_trajectory(times: Array, values: Array) -> PiecewisePolynomial:
    """First-order hold through values (N, n) at times (N,) [s], for references with corners."""
    return PiecewisePolynomial.FirstOrderHold(times, np.asarray(values).T)
