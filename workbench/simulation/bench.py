"""How fast the station is, against what it is made of: a bare Drake plant, finer steps of itself, one process."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform
from pydrake.multibody.plant import DiscreteContactApproximation
from pydrake.multibody.tree import PdControllerGains
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.analysis import Simulator

from workbench.motion import Commands
from workbench.robot import ConfigureParser, RobotModel
from workbench.servo import ServoLaw
from workbench.servo.bank import find_actuator, servo_joints
from workbench.simulation.batch import Job, simulate_batch
from workbench.simulation.config import SimulationConfig
from workbench.simulation.contact import AddGround, SelectFeet
from workbench.simulation.reference import ConnectReference, linear_trajectory, reference_columns
from workbench.simulation.rollout import Simulation

Array = NDArray[np.float64]
LEAD = 0.1


@dataclass(frozen=True)
class Race:
    """Two ways to do the same, timed in turns. seconds: the best of each; speed: first over second."""

    first: float
    second: float

    @property
    def speed(self) -> float:
        """How fast the first is, measured in the second."""
        return self.second / self.first


def race(first: Callable[[], object], second: Callable[[], object], repeats: int) -> Race:
    """Times both in turns, so that a busy machine slows both; the best of `repeats` counts."""
    best = [float("inf"), float("inf")]
    for _ in range(repeats):
        for i, run in enumerate((first, second)):
            began = time.perf_counter()
            run()
            best[i] = min(best[i], time.perf_counter() - began)
    return Race(*best)


def station_against_bare_plant(model: RobotModel, commands: Commands, step: float = 1e-3, repeats: int = 5) -> Race:
    """The station with the full servo law, logs and contact forces, against the same model, ground and step with nothing but
    Drake's own PD on the same ramped reference."""
    station = Simulation(model, SimulationConfig(time_step=step))
    bare = _bare_plant(model, commands, step)
    station.run(commands, lead=LEAD)
    bare()
    return race(lambda: station.run(commands, lead=LEAD), bare, repeats)


def joint_error(model: RobotModel, commands: Commands, step: float, converged: float = 1e-4) -> float:
    """RMS over joints and time [rad] by which a rollout at `step` misses one at the step `converged`."""
    coarse, fine = (Simulation(model, SimulationConfig(time_step=h, contact_period=0.0)).run(commands, lead=LEAD)
                    for h in (step, converged))
    moving = coarse.time >= 0
    exact = np.column_stack([np.interp(coarse.time[moving], fine.time, column) for column in fine.q.T])
    return float(np.sqrt(np.mean(np.square(coarse.q[moving] - exact))))


def real_time_factor(model: RobotModel, commands: Commands, step: float, repeats: int = 3) -> float:
    """Simulated seconds per second of the station with the full servo law, the best of `repeats`."""
    station = Simulation(model, SimulationConfig(time_step=step))
    best = float("inf")
    for _ in range(repeats + 1):
        began = time.perf_counter()
        station.run(commands, lead=LEAD)
        best = min(best, time.perf_counter() - began)
    return (commands.end + LEAD) / best


def batch_on_two_processes(model: RobotModel, commands: Commands, rollouts: int = 64) -> Race:
    """The same rollouts on two processes, which are up and have built their stations, against one."""
    jobs = [Job(model, SimulationConfig(), commands, lead=LEAD)] * rollouts
    for n in (1, 2):
        simulate_batch(jobs[:4], n)
    return race(lambda: simulate_batch(jobs, 2), lambda: simulate_batch(jobs, 1), 1)


def _bare_plant(model: RobotModel, commands: Commands, step: float) -> Callable[[], object]:
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
        actuator = find_actuator(plant, joint)
        actuator.set_controller_gains(PdControllerGains(p=float(law.gain[i] * law.full_torque[i]), d=float(law.damping[i])))
        actuator.set_effort_limit(float(law.full_torque[i]))
        actuator.set_default_rotor_inertia(float(law.inertia[i]))
        actuator.set_default_gear_ratio(1.0)
    plant.Finalize()
    ConnectReference(builder.builder(), plant, joints, with_velocity=False)
    diagram = builder.Build()
    times = np.arange(0.0, LEAD + commands.end, 1e-3)
    rows = commands.reordered(model.joints).reference(times - LEAD)[:, reference_columns(plant, model)]
    diagram.GetSubsystemByName("joint_reference").UpdateTrajectory(linear_trajectory(times, rows))
    station = Simulation(model, SimulationConfig(time_step=step))  # for the pose in which it stands
    rest = station.run(commands, duration=step, lead=LEAD)
    assert rest.p_WB is not None
    height = float(rest.p_WB[0, 2])

    def run() -> None:
        context = diagram.CreateDefaultContext()
        plant_context = diagram.GetMutableSubsystemContext(plant, context)
        plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context, plant.GetBodyByName(model.base), RigidTransform([0, 0, height]))
        simulator = Simulator(diagram, context)
        simulator.AdvanceTo(LEAD + commands.end)

    return run
