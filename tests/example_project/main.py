"""A Drake project of its own: the puppy nods on this project's floor, with the servos that the workbench brings."""

from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from workbench.robot import ConfigureParser, puppy_model
from workbench.simulation import AddServos

builder = DiagramBuilder()
plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=1e-3)
parser = Parser(plant)
ConfigureParser(parser)
parser.AddModelsFromUrl("package://puppy/puppy.sdf")
floor, friction = RigidTransform([0, 0, -0.5]), CoulombFriction(0.5, 0.5)
plant.RegisterCollisionGeometry(plant.world_body(), floor, Box(9, 9, 1), "floor", friction)
bank = AddServos(builder, plant, puppy_model())
simulator = Simulator(builder.Build())
context = bank.GetMyContextFromRoot(simulator.get_mutable_context())
bank.GetInputPort("goal_position").FixValue(context, [0.3 if joint == "neck" else 0.0 for joint in bank.joints])
bank.GetInputPort("moving_speed").FixValue(context, [1.0 for joint in bank.joints])
simulator.AdvanceTo(1.0)
state = plant.GetMyContextFromRoot(simulator.get_context())
height = plant.EvalBodyPoseInWorld(state, plant.GetBodyByName("body_link")).translation()[2]
print(plant.GetJointByName("neck").get_angle(state), height)
