"""The station: plant, contact and servos of one robot as a RobotDiagram, with the same ports whatever drives it."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Mapping

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Role
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    ContactModel,
    DiscreteContactApproximation,
    ExternallyAppliedSpatialForce,
    MultibodyPlant,
)
from pydrake.multibody.tree import ModelInstanceIndex, PdControllerGains
from pydrake.planning import RobotDiagram, RobotDiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, VectorLogSink

from workbench.effects.apply import Physics, physics_of
from workbench.effects.sdf import SPRING_TIME
from workbench.files import InputError
from workbench.robot import ConfigureParser, RobotModel
from workbench.robot.model_source.checks import quiet_drake
from workbench.servo import AddServos, ServoLaw
from workbench.servo.bank import find_actuator, servo_joints
from workbench.simulation.boxes import AddBoxes
from workbench.simulation.config import SimulationConfig
from workbench.simulation.contact import AddGround, SelectFeet, SetFootContact
from workbench.simulation.fast_servo import AddFastServos
from workbench.simulation.gantry import AddGantry, ConnectPath
from workbench.simulation.reference import ConnectReference

_APPROXIMATIONS = {"lagged": DiscreteContactApproximation.kLagged, "sap": DiscreteContactApproximation.kSap,
                   "similar": DiscreteContactApproximation.kSimilar}
IDEAL_GAINS = PdControllerGains(p=1e5, d=1e3)
"""Stiffness and damping of the ideal drive [N m/rad, N m s/rad]: 1.5 N m deflects it by 15 microradians."""


def MakeStation(model: RobotModel, config: SimulationConfig | None = None) -> RobotDiagram:
    """A robot in its world: plant, floor, servos, and a log of each port. InputError for a base or an effect that does not fit.

    Inputs: `goal_position` (n) rad and `moving_speed` (n) rad/s, `torque_enable` (n) (drive "servo"). Joints in
    `model.joints`' order. Outputs: `state` (nq + nv) of the plant, `net_actuation`, `contact_results`, `query_object` for
    Drake's visualizers, and with drive "servo" `motor_torque` (n) N m, `duty` (n), `reference` (n) rad. `moving_speed` and
    `torque_enable` may stay unconnected. Systems: "plant", "scene_graph", "servo_bank", "joint_reference" (the trajectory that
    drives "fast_servo" and "ideal" follow), "base_path" (base "path"), and logs named after the port they write down:
    "state_log", "net_actuation_log", "reference_log".
    """
    config = (config or SimulationConfig()).of(model)
    config.check()
    physics = physics_of(model)
    _check_ends(config, physics)
    model.check_base(floating=config.base == "free")
    builder = RobotDiagramBuilder(time_step=config.time_step)
    plant = builder.plant()
    instance = _add_model(builder, model, physics)
    _warn_of_no_shape(builder, instance, model, config)
    _steady_springs(plant, physics)
    plant.mutable_gravity_field().set_gravity_vector(physics.gravity)
    if config.time_step > 0:
        plant.set_discrete_contact_approximation(_APPROXIMATIONS[config.approximation])
    plant.set_contact_model(ContactModel.kPoint if config.contact == "point" else ContactModel.kHydroelasticWithFallback)
    SelectFeet(plant, builder.scene_graph(), instance, config.contact, config.hydroelastic_modulus)
    if config.base == "free":
        AddGround(plant, builder.scene_graph(), instance, physics.ground)
        SetFootContact(plant, builder.scene_graph(), instance, _feet(model, physics.foot_friction), physics.foot_stiffness)
        if config.boxes:
            AddBoxes(plant, builder.scene_graph(), config.boxes, config.boxes_seed)
    elif config.base == "fixed" and not model.kinematics.fixed_to_world:
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(model.base, instance), RigidTransform([0, 0, 1.0]))
    elif config.base == "path":
        AddGantry(builder, model.base, instance)
    plant.SetUseSampledOutputPorts(False)  # a step solved for a log serves the update that follows; faster than sampling
    _add_drive(builder, plant, model, config, physics)
    if physics.tether.any():
        _add_tether(builder, plant, model.base, physics.tether)
    if config.base == "path":
        ConnectPath(builder)
    _add_logs(builder, plant, config)
    return builder.Build()


def _steady_springs(plant: MultibodyPlant, physics: Physics) -> None:
    """More damping between servos and links than the description has, where the step is too long for it (SPRING_TIME)."""
    more = plant.time_step() / (2 * SPRING_TIME)
    if more > 1:
        for stage in itertools.chain.from_iterable(physics.stages.values()):
            joint = plant.GetJointByName(stage)
            joint.set_default_damping(more * joint.default_damping())


def _check_ends(config: SimulationConfig, physics: Physics) -> None:
    if physics.ends and config.time_step == 0 and not config.uses_cenic:
        raise InputError(None, "time_step: an effect gives joints hard ends, which Drake's integrators turn through; expected a "
                         "step above 0, or the integrator 'cenic'")


def _add_model(builder: RobotDiagramBuilder, model: RobotModel, physics: Physics) -> ModelInstanceIndex:
    parser = builder.parser()
    ConfigureParser(parser)
    with quiet_drake():
        if physics.description is not None:
            return parser.AddModelsFromString(physics.description, "sdf")[0]
        return parser.AddModels(str(model.path))[0]


def _warn_of_no_shape(builder: RobotDiagramBuilder, instance: ModelInstanceIndex, model: RobotModel, config: SimulationConfig
                      ) -> None:
    plant, inspector = builder.plant(), builder.scene_graph().model_inspector()
    frames = [plant.GetBodyFrameIdOrThrow(b) for b in plant.GetBodyIndices(instance)]
    if config.base == "free" and not any(inspector.NumGeometriesForFrameWithRole(f, Role.kProximity) for f in frames):
        warnings.warn(f"{model.description}: no link has a collision shape, so this robot falls through the ground; expected "
                      "shapes, or SimulationConfig(base=\"fixed\")", stacklevel=3)


def _feet(model: RobotModel, friction: Mapping[str, float]) -> dict[str, float]:
    """Pair friction by the foot's link."""
    return {model.foot_links[foot]: value for foot, value in friction.items()}


def _add_tether(builder: RobotDiagramBuilder, plant: MultibodyPlant, base: str, force: np.ndarray) -> None:
    pull = ExternallyAppliedSpatialForce()
    pull.body_index = plant.GetBodyByName(base).index()
    pull.F_Bq_W = SpatialForce(np.zeros(3), force)
    source = builder.builder().AddSystem(ConstantValueSource(Value([pull])))
    source.set_name("tether")
    builder.builder().Connect(source.get_output_port(), plant.get_applied_spatial_force_input_port())


def _add_drive(
    builder: RobotDiagramBuilder, plant: MultibodyPlant, model: RobotModel, config: SimulationConfig, physics: Physics
) -> None:
    diagram = builder.builder()
    if config.drive == "servo":
        implicit = config.time_step > 0 or config.uses_cenic
        bank = AddServos(diagram, plant, model, friction="implicit" if implicit else "bristle", law=physics.law,
                         terms=physics.terms)
        for port in ("goal_position", "moving_speed", "torque_enable"):
            diagram.ExportInput(bank.GetInputPort(port), port)
        for port in ("motor_torque", "duty", "reference"):
            diagram.ExportOutput(bank.GetOutputPort(port), port)
    elif config.drive == "fast_servo":
        law = physics.law
        if physics.servo_terms or law.lag.any() or law.derivative.any() or np.isfinite(law.ramp).any():
            raise InputError(None, "drive: these servos do more than their position law (an effect, load friction, a goal "
                             "ramp, a command filter or a derivative gain); expected drive 'servo'")
        AddFastServos(diagram, plant, model, law)
    elif config.drive == "ideal":
        AddIdealDrive(builder, plant, model, physics.law)
    else:
        plant.Finalize()


def AddIdealDrive(builder: RobotDiagramBuilder, plant: MultibodyPlant, model: RobotModel, law: ServoLaw) -> None:
    """Joints that follow "joint_reference" exactly: Drake's implicit PD, stiff and without an effort limit."""
    joints = servo_joints(plant, model)
    for joint, inertia in zip(joints, law.inertia):
        actuator = find_actuator(plant, joint)
        joint.set_default_damping(0.0)
        actuator.set_default_rotor_inertia(float(inertia))
        actuator.set_default_gear_ratio(1.0)
        actuator.set_effort_limit(np.inf)
        actuator.set_controller_gains(IDEAL_GAINS)
    plant.Finalize()
    ConnectReference(builder.builder(), plant, joints, with_velocity=True)


def _add_logs(builder: RobotDiagramBuilder, plant: MultibodyPlant, config: SimulationConfig) -> None:
    diagram = builder.builder()
    diagram.ExportOutput(plant.get_state_output_port(), "state")
    diagram.ExportOutput(plant.get_contact_results_output_port(), "contact_results")
    diagram.ExportOutput(builder.scene_graph().get_query_output_port(), "query_object")
    logged = {"state": plant.get_state_output_port()}
    if plant.num_actuators():
        logged["net_actuation"] = plant.get_net_actuation_output_port()
        diagram.ExportOutput(logged["net_actuation"], "net_actuation")
    if config.drive == "servo":
        bank = builder.builder().GetSubsystemByName("servo_bank")
        logged["reference"] = bank.GetOutputPort("reference")
        if bank.HasOutputPort("friction_relief"):
            logged |= {name: bank.GetOutputPort(name) for name in ("motor_torque", "friction_relief")}
        if config.time_step == 0:
            logged["generalized_force"] = bank.GetOutputPort("generalized_force")
    for name, port in logged.items():
        log = diagram.AddSystem(VectorLogSink(port.size(), config.logged_every))
        log.set_name(f"{name}_log")
        diagram.Connect(port, log.get_input_port())
