"""A walk that is put back to where another was."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from workbench.motion import load_motion
from workbench.motion.commands import Commands
from workbench.robot import data_file, puppy_model
from workbench.simulation import Simulation, SimulationConfig
from workbench.simulation.steady import BaseSetter, BaseStates


@pytest.fixture(scope="module")
def station() -> Simulation:
    return Simulation(puppy_model(), SimulationConfig(time_step=2e-3, settle=0.4, contact_period=0))


@pytest.fixture(scope="module")
def commands() -> Commands:
    return load_motion(data_file("robotis_walk.csv"), puppy_model()).commands(cycles=4)


def at(times: list[float], turn: Rotation, v: tuple[float, float, float] = (0, 0, 0)) -> BaseStates:
    n = len(times)
    return BaseStates(np.array(times), np.tile(turn.as_quat(scalar_first=True), (n, 1)), np.tile(v, (n, 1)), np.zeros((n, 3)))


def setter(station: Simulation, states: BaseStates) -> BaseSetter:
    station.run(None, 0.01)  # at rest
    return BaseSetter(states, station.plant, station.diagram.scene_graph(), station._base, station._plant_context)


def test_a_walk_that_is_where_it_was_recorded_goes_on_as_it_would(station: Simulation, commands: Commands):
    free = station.run(commands, 1.2)
    k = [int(np.argmin(np.abs(free.time - t))) for t in (0.4, 0.8)]
    rest = Rotation.from_quat(free.quat_WB[0], scalar_first=True)
    there = (Rotation.from_quat(free.quat_WB[k], scalar_first=True) * rest.inv()).as_quat(scalar_first=True)
    again = station.run(commands, 1.2, steadied=BaseStates(free.time[k], there, np.zeros((2, 3)), np.zeros((2, 3))))
    assert np.abs(again.q - free.q).max() < 1e-3
    assert np.abs(again.p_WB - free.p_WB).max() < 1e-3


def test_a_robot_that_has_tipped_the_other_way_is_put_back(station: Simulation):
    tilt = Rotation.from_euler("y", 6.0, degrees=True)
    put = setter(station, at([0.0], tilt, (0.1, 0.0, 0.05)))
    depth, rest = put._lowest(), put._rest
    put.put(0, 0.0)
    X_WB = station.plant.GetFreeBodyPose(station._plant_context, station._base)
    V_WB = station._base.EvalSpatialVelocityInWorld(station._plant_context)
    apart = Rotation.from_matrix(X_WB.rotation().matrix()) * (tilt * rest).inv()
    assert np.rad2deg(apart.magnitude()) < 0.01
    assert np.allclose(V_WB.translational(), (0.1, 0.0, 0.05), atol=1e-4)
    assert put._lowest() == pytest.approx(depth, abs=1e-9)


def test_noise_of_cameras_hardly_moves_it(station: Simulation):
    put = setter(station, at([0.0], Rotation.from_euler("x", 0.1, degrees=True), (1.0, 0.0, 0.0)))
    put.put(0, 0.0)
    X_WB = station.plant.GetFreeBodyPose(station._plant_context, station._base)
    moved = Rotation.from_matrix(X_WB.rotation().matrix()) * put._rest.inv()
    assert np.rad2deg(moved.magnitude()) < 0.01


def test_heading_is_the_recorded_one_and_the_path_told_in_one_piece(station: Simulation, commands: Commands):
    """A floor that is the same everywhere makes the same walk of another heading."""
    free = station.run(commands, 1.0)
    turned = station.run(commands, 1.0, steadied=at([0.0], Rotation.from_euler("z", 50.0, degrees=True)))
    assert np.abs(turned.q - free.q).max() < 1e-3
    assert np.abs(turned.p_WB - free.p_WB).max() < 2e-3
    assert np.abs(np.diff(turned.p_WB, axis=0)).max() < 2e-3
