"""The baseline for the station's speed: the same model, contact, ground and step, driven only by Drake's own PD controllers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform
from pydrake.multibody.plant import DiscreteContactApproximation
from pydrake.multibody.tree import PdControllerGains
from pydrake.planning import RobotDiagram, RobotDiagramBuilder
from pydrake.systems.analysis import Simulator

from workbench.motion import Commands
from workbench.recording import Take
from workbench.robot import ConfigureParser, RobotModel
from workbench.servo import ServoLaw
from workbench.servo.bank import find_actuator, servo_joints
from workbench.simulation.config import SimulationConfig
from workbench.simulation.contact import AddGround, SelectFeet
from workbench.simulation.reference import ConnectReference, linear_trajectory, reference_columns


class BarePlant:
    """The robot with free base and point contact, built in Drake in the usual way: PD with the gain of the servo law, back-EMF
    and viscous friction as joint damping, reflected inertia, and the servos' ramped reference from a TrajectorySource.

    It has no joint friction, margin, punch or log. A run starts from the first state of `take` and lasts as long."""

    def __init__(self, model: RobotModel, commands: Commands, take: Take, step: float) -> None:
        diagram = _build(model, step)
        plant = diagram.plant()
        self._end = float(take.time[-1] - take.time[0])
        times = np.arange(0.0, self._end + 2 * step, step)
        reference = commands.reordered(model.joints).reference(times + take.time[0])[:, reference_columns(plant, model)]
        source = diagram.GetSubsystemByName("joint_reference")
        source.UpdateTrajectory(linear_trajectory(times - step, reference))  # Drake's PD acts on the end of the step
        self._context = diagram.CreateDefaultContext()
        self._plant_context = diagram.GetMutableSubsystemContext(plant, self._context)
        self._joints = servo_joints(plant, model)
        for joint, angle in zip(self._joints, take.q[0]):
            joint.set_angle(self._plant_context, float(angle))
        assert take.p_WB is not None
        assert take.quat_WB is not None
        pose = RigidTransform(Quaternion(take.quat_WB[0] / np.linalg.norm(take.quat_WB[0])), take.p_WB[0])
        plant.SetFloatingBaseBodyPoseInWorldFrame(self._plant_context, plant.GetBodyByName(model.base), pose)
        self._start = self._context.Clone()
        self._simulator = Simulator(diagram, self._context)

    def run(self) -> None:
        """Simulates the whole motion from the start."""
        self._context.SetTimeStateAndParametersFrom(self._start)
        self._simulator.Initialize()
        self._simulator.AdvanceTo(self._end)

    def joint_angles(self) -> NDArray[np.float64]:
        """Current joint angles (n,) [rad], in the model's order."""
        return np.array([joint.get_angle(self._plant_context) for joint in self._joints])


def _build(model: RobotModel, step: float) -> RobotDiagram:
    builder = RobotDiagramBuilder(time_step=step)
    plant = builder.plant()
    ConfigureParser(builder.parser())
    (instance,) = builder.parser().AddModels(str(model.path))
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    SelectFeet(plant, builder.scene_graph(), instance, "point", SimulationConfig().hydroelastic_modulus)
    AddGround(plant, builder.scene_graph(), instance, model.ground)
    joints = servo_joints(plant, model)
    law = ServoLaw.of([model.servo(j.name()) for j in joints])
    for i, joint in enumerate(joints):
        joint.set_default_damping(float(law.damping[i]))
        actuator = find_actuator(plant, joint)
        actuator.set_controller_gains(PdControllerGains(p=float(law.gain[i] * law.full_torque[i]), d=0.0))
        actuator.set_effort_limit(float(law.full_torque[i]))
        actuator.set_default_rotor_inertia(float(law.inertia[i]))
        actuator.set_default_gear_ratio(1.0)
    plant.Finalize()
    ConnectReference(builder.builder(), plant, joints, with_velocity=False)
    return builder.Build()
