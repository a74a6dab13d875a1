"""A robot that was held in every take is held in a simulation, too, where nothing else is said."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydrake.systems.analysis import Simulator

import workbench
from tests.command import refused
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.inspect.problems import model_problems_of
from workbench.robot import RobotModel, load_model, puppy_model, save_model
from workbench.simulation import Job, MakeStation, SimulationConfig

LOG = Path(__file__).parents[2] / "data" / "tutorial_arm" / "takes" / "slow.csv"
BARE = """<robot name="bare">
<link name="base">{0}</link><link name="arm">{0}</link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="5"/></joint></robot>""".format(
    '<inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>')


def _of_session(folder: Path, *bases: str) -> RobotModel:
    """The robot of a session with takes of these bases."""
    (folder / "bare.urdf").write_text(BARE)
    takes = [{"name": str(i), "recording": str(LOG), "base": base} for i, base in enumerate(bases)]
    (folder / "session.yaml").write_text(yaml.safe_dump({"format": 1, "robot": {"model": "bare.urdf"}, "takes": takes}))
    return load_session(folder).model


def _height(model: RobotModel, config: SimulationConfig | None = None) -> float:
    """Of the base after 0.3 s without a controller [m]."""
    station = MakeStation(model, config)
    simulator = Simulator(station)
    context = simulator.get_mutable_context()
    station.GetInputPort("goal_position").FixValue(context, np.zeros(len(model.joints)))
    simulator.AdvanceTo(0.3)
    plant = station.plant()
    body = plant.GetBodyByName(model.base)
    return float(plant.EvalBodyPoseInWorld(station.GetSubsystemContext(plant, context), body).translation()[2])


def test_what_a_session_held_stays_where_it_is_through_model_yaml(tmp_path: Path) -> None:
    model = _of_session(tmp_path, "fixed", "fixed")
    assert model.usual_base == "fixed"
    read = workbench.load_model(save_model(model, tmp_path / "model.yaml"))
    assert _height(read) == pytest.approx(1.0)
    assert Job(read, SimulationConfig()).config.base == "fixed"
    assert not any("falls through" in text for text in model_problems_of(read))


def test_one_free_take_makes_it_free(tmp_path: Path) -> None:
    model = _of_session(tmp_path, "fixed", "free")
    written = save_model(model, tmp_path / "model.yaml")
    assert "held" not in yaml.safe_load(written.read_text())["robot"]
    assert load_model(written).usual_base == puppy_model().usual_base == "free"


def test_a_free_base_that_nothing_stops_is_told_once(tmp_path: Path) -> None:
    path = tmp_path / "bare.urdf"
    path.write_text(BARE)
    model = RobotModel(str(path))
    with pytest.warns(UserWarning, match="no link has a collision shape") as told:
        MakeStation(model)
    assert len(told) == 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert _height(model.with_held(True)) == pytest.approx(1.0)
        MakeStation(puppy_model())


def test_held_is_true_or_false(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bare.urdf").write_text(BARE)
    (tmp_path / "model.yaml").write_text("format: 1\nrobot: {model: bare.urdf, held: 1}\n")
    with pytest.raises(InputError, match=r"robot\.held: expected true or false, got 1"):
        load_model(tmp_path / "model.yaml")
    assert "robot.held" in refused(capsys, "inspect", str(tmp_path / "model.yaml"))
