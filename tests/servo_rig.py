"""A one-joint rig: a weightless arm of 0.1 m with a point mass at its end, hanging down at zero, driven by one servo."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydrake.multibody.plant import DiscreteContactApproximation
from pydrake.planning import RobotDiagram, RobotDiagramBuilder
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig

from workbench.robot import RobotModel, ServoConstants
from workbench.servo import AddServos, ServoBank, ServoTerm

LENGTH = 0.1
GRAVITY = 9.81
SDF = """<?xml version="1.0"?><sdf version="1.9"><model name="rig"><link name="base"/>
<link name="arm"><inertial><pose>0 0 -{length} 0 0 0</pose><mass>{mass}</mass>
<inertia><ixx>1e-9</ixx><iyy>1e-9</iyy><izz>1e-9</izz></inertia></inertial></link>
<joint name="j" type="revolute"><parent>base</parent><child>arm</child>
<axis><xyz>0 1 0</xyz><dynamics><damping>5</damping></dynamics><limit><effort>99</effort></limit></axis></joint></model></sdf>"""


@dataclass
class Rig:
    """The rig in a diagram, ready to run."""

    diagram: RobotDiagram
    bank: ServoBank
    simulator: Simulator

    @property
    def context(self):
        return self.simulator.get_mutable_context()

    @property
    def plant_context(self):
        return self.diagram.plant().GetMyMutableContextFromRoot(self.context)

    @property
    def joint(self):
        return self.diagram.plant().GetJointByName("j")

    def command(self, goal: float, speed: float = 0.0, enabled: bool = True) -> None:
        for port, value in (("goal_position", goal), ("moving_speed", speed), ("torque_enable", float(enabled))):
            self.diagram.GetInputPort(port).FixValue(self.context, [value])

    def put(self, angle: float, rate: float = 0.0, reference: float | None = None) -> None:
        self.joint.set_angle(self.plant_context, angle)
        self.joint.set_angular_rate(self.plant_context, rate)
        self.bank.SetReference(self.bank.GetMyMutableContextFromRoot(self.context), [angle if reference is None else reference])
        self.simulator.Initialize()

    def run(self, duration: float) -> tuple[float, float]:
        self.simulator.AdvanceTo(self.context.get_time() + duration)
        return self.joint.get_angle(self.plant_context), self.joint.get_angular_rate(self.plant_context)

    def output(self, name: str) -> float:
        return float(self.bank.GetOutputPort(name).Eval(self.bank.GetMyContextFromRoot(self.context))[0])


def rig_model(folder: Path, servo: ServoConstants, mass: float = 0.1) -> RobotModel:
    path = folder / "rig.sdf"
    path.write_text(SDF.format(length=LENGTH, mass=mass))
    return RobotModel(description=str(path), base="base", servos={"j": servo})


def make_rig(folder: Path, servo: ServoConstants, mass: float = 0.1, gravity: bool = True, time_step: float = 1e-3,
             integrator: str = "", accuracy: float = 1e-6, approximation: str = "kLagged",
             terms: Sequence[ServoTerm] = ()) -> Rig:
    model = rig_model(folder, servo, mass)
    builder = RobotDiagramBuilder(time_step=time_step)
    plant = builder.plant()
    builder.parser().AddModels(str(model.path))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -GRAVITY if gravity else 0])
    if time_step > 0:
        plant.set_discrete_contact_approximation(getattr(DiscreteContactApproximation, approximation))
    bank = AddServos(builder.builder(), plant, model, friction="implicit" if integrator == "cenic" else None, terms=terms)
    for port in ("goal_position", "moving_speed", "torque_enable"):
        builder.builder().ExportInput(bank.GetInputPort(port), port)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    if integrator:
        ApplySimulatorConfig(SimulatorConfig(integration_scheme=integrator, accuracy=accuracy, max_step_size=0.01), simulator)
    return Rig(diagram, bank, simulator)
