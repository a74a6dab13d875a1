"""Adds the servo bank to a diagram, on any plant that has the model's joints."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointActuator, PdControllerGains, RevoluteJoint
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from workbench.files import InputError
from workbench.robot import RobotModel
from workbench.servo.law import ServoLaw
from workbench.servo.nominal import nominal_terms
from workbench.servo.system import ServoBank
from workbench.servo.term_bank import TermBank
from workbench.servo.terms import ServoTerm, most_friction

Friction = Literal["implicit", "bristle"]

HOLDING_DAMPING = 1e3
"""Damping [N m s/rad] below which Coulomb friction creeps in discrete plants: at 0.06 N m a joint at rest creeps by less
than 0.06/1000 rad/s (0.003 deg/s)."""
MOST_CREEP = 6e-5
"""Largest creep of a joint at rest whose friction varies [rad/s]: that of 0.06 N m at HOLDING_DAMPING."""


def find_actuator(plant: MultibodyPlant, joint: RevoluteJoint) -> JointActuator:
    """The joint's actuator, added to the plant if it has none; InputError if it has several."""
    found = [a for a in map(plant.get_joint_actuator, plant.GetJointActuatorIndices()) if a.joint().index() == joint.index()]
    if len(found) > 1:
        raise InputError(None, f"joint '{joint.name()}' has {len(found)} actuators; expected one, which the servo takes over")
    if found:
        return found[0]
    return plant.AddJointActuator(joint.name(), joint)


def servo_joints(plant: MultibodyPlant, model: RobotModel) -> list[RevoluteJoint]:
    """The plant's joints that the model's servos drive, in the model's order; InputError names one that is missing."""
    out = []
    for name in model.joints:
        if not plant.HasJointNamed(name):
            raise InputError(None, f"the plant has no joint '{name}' (model {model.description})")
        out.append(plant.GetJointByName(name))
    return out


def SetServoPhysics(plant: MultibodyPlant, model: RobotModel, friction: Friction, law: ServoLaw | None = None,
                    terms: Sequence[ServoTerm] = ()) -> ServoLaw:
    """Sets on the plant's joints the properties that the servos add to them, replacing those of the SDF: damping, reflected
    inertia and, where it is "implicit", Coulomb friction (an actuator that brakes with at most that torque, or with the largest
    that `terms` may require).

    A joint's only actuator is used, because CENIC clamps the sum of several once, and because a joint's
    reflected inertia is that of its last actuator.
    """
    joints = servo_joints(plant, model)
    law = law or ServoLaw.of([model.servo(j.name()) for j in joints])
    most = most_friction((*nominal_terms(law), *terms), law)
    for i, joint in enumerate(joints):
        actuator = find_actuator(plant, joint)
        joint.set_default_damping(float(law.damping[i]))
        actuator.set_default_rotor_inertia(float(law.inertia[i]))
        actuator.set_default_gear_ratio(1.0)
        if friction == "implicit" and most[i] > 0:
            damping = HOLDING_DAMPING if most[i] == law.coulomb[i] else max(HOLDING_DAMPING, float(most[i]) / MOST_CREEP)
            actuator.set_controller_gains(PdControllerGains(p=0.0, d=damping))
            actuator.set_effort_limit(float(most[i]))
        else:
            actuator.set_effort_limit(np.inf)
    return law


def AddServos(builder: DiagramBuilder, plant: MultibodyPlant, model: RobotModel, period: float | None = None,
              friction: Friction | None = None, law: ServoLaw | None = None, terms: Sequence[ServoTerm] = ()) -> ServoBank:
    """Puts the model's servos on the joints of the caller's plant and wires them; returns the bank, whose inputs `goal_position`
    (n) [rad] and `moving_speed` (n) [rad/s], joints in `model.joints`' order, are left to connect.

    Call it on a plant that is not yet finalized, as the servos change its joints; it finalizes the plant. `period` [s] of
    the goal ramp: the plant's step, or 1 ms in a continuous one. Takes the plant's applied_generalized_force input and, for
    implicit friction, desired_state of the instances that hold the joints. `friction`: "implicit" (discrete plants, the
    default there, and CENIC) or "bristle" (continuous plants under an integrator whose error control sees the bristles;
    CENIC's does not: it steps over them and slides without friction). `law`: replaces the model's nominal constants.
    `terms`: behaviour of servos beyond the law. A goal_delay of the model is in the commands of `simulate`, not in the bank: code
    that sends goals itself sends them that much later. In a discrete plant they take `period` to be its step, and make its output
    ports unsampled: a plant that samples them updates before the bank does, whose events then see the step's end. Friction that
    varies needs bristles or a discrete plant. InputError for a plant that is finalized, lacks a joint, or does not support
    `friction`, and for a model with effects, which MakeStation takes.
    """
    if model.effects and law is None:
        names = ", ".join(dict.fromkeys(e.effect for e in model.effects))
        raise InputError(None, f"the model has effects ({names}), which may change more than servos: expected MakeStation(model)"
                               ", which has them all, or the model without them, model.with_effects(())")
    if friction is None:
        friction = "implicit" if plant.time_step() > 0 else "bristle"
    if friction == "bristle" and plant.time_step() > 0:
        raise InputError(None, "bristle friction needs a continuous plant; a discrete one takes friction='implicit'")
    if plant.is_finalized():
        raise InputError(None, "the plant is finalized already; AddServos changes its joints and finalizes it itself")
    law = SetServoPhysics(plant, model, friction, law, terms)
    terms = (*nominal_terms(law), *terms)
    most, period = most_friction(terms, law), period or plant.time_step() or 1e-3
    varies = bool((most > law.coulomb).any())
    if varies and friction == "implicit" and plant.time_step() == 0:
        raise InputError(None, "friction that varies needs a discrete plant, or friction='bristle'; CENIC takes neither")
    if terms and plant.time_step() > 0:
        if period != plant.time_step():
            raise InputError(None, f"period {period:g} s: with terms it is the plant's step, {plant.time_step():g} s")
        plant.SetUseSampledOutputPorts(False)
    plant.Finalize()
    joints = servo_joints(plant, model)
    bristles = friction == "bristle" and bool(most.any())
    bank = TermBank(plant, joints, law, period, bristles, terms) if terms else ServoBank(plant, joints, law, period, bristles)
    bank.set_name("servo_bank")
    builder.AddSystem(bank)
    builder.Connect(plant.get_state_output_port(), bank.GetInputPort("plant_state"))
    builder.Connect(bank.GetOutputPort("generalized_force"), plant.get_applied_generalized_force_input_port())
    if friction == "implicit":
        arm_friction(builder, plant, joints)
        if varies:
            builder.Connect(plant.get_net_actuation_output_port(), bank.GetInputPort("net_actuation"))
    return bank


def arm_friction(builder: DiagramBuilder, plant: MultibodyPlant, joints: Sequence[RevoluteJoint]) -> None:
    """Connects zeros as desired state of the joints' instances: Drake disarms controllers whose desired state is unconnected."""
    for instance in {j.model_instance() for j in joints}:
        port = plant.get_desired_state_input_port(instance)
        zeros = builder.AddSystem(ConstantVectorSource(np.zeros(port.size())))
        zeros.set_name(f"friction_reference_{plant.GetModelInstanceName(instance)}")
        builder.Connect(zeros.get_output_port(), port)
