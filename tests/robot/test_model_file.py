"""model.yaml: the round trip, and errors that name the wrong entry."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.gap_sessions import write_session
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.robot import EffectSpec, Ground, Posterior, RobotModel, load_model, load_model_file, puppy_model, save_model
from workbench.robot.model_file import parameter_names
from workbench.simulation import MakeStation

EFFECTS = (EffectSpec("backlash", ("two",), {"gap": 3.1}),
           EffectSpec("payload", ("upper",), {"mass": 0.05, "position": (0.01, 0.0, -0.02)}),
           EffectSpec("timing_drift", (), {"per_pose": 1e-5}))


@pytest.fixture
def arm(tmp_path: Path) -> RobotModel:
    """The arm with three effects, and servos that differ."""
    model = load_session(write_session(tmp_path)).model
    worn = model.servo("three").updated({"proportional_gain": 2.5, "model": "1e5"})
    return replace(model, servos={**model.servos, "three": worn}, ground=Ground(0.6, np.inf, 20.0), effects=EFFECTS)


def test_everything_comes_back(arm: RobotModel, tmp_path: Path) -> None:
    names = parameter_names(arm.effects)
    assert names == ("backlash(two).gap", "payload(upper).mass", "payload(upper).position.x", "payload(upper).position.y",
                     "payload(upper).position.z", "timing_drift.per_pose")
    covariance = np.diag([0.1, 1e-4, 1e-4, np.inf, 1e-4, 1e-12])
    posterior = Posterior(names, np.array([3.1, 0.05, 0.01, 0.0, -0.02, 1e-5]), covariance)
    provenance = {"seed": 0, "model_sha256": arm.sha256, "seconds": 94.5}
    read = load_model_file(save_model(arm, tmp_path / "out/model.yaml", posterior, provenance))
    assert read.model.as_dict() | {"description": ""} == arm.as_dict() | {"description": ""}
    assert read.model.path == arm.path
    assert read.posterior.names == names
    np.testing.assert_array_equal(read.posterior.covariance, covariance)
    np.testing.assert_array_equal(read.posterior.mean, posterior.mean)
    assert read.provenance == provenance


def test_a_posterior_is_put_in_the_order_of_the_effects() -> None:
    effects = (*EFFECTS, EffectSpec("zero_offset", ("two",), {"angle": 1.0}), EffectSpec("zero_offset", ("two",), {"angle": 2.0}))
    names = parameter_names(effects)
    n = len(names)
    shuffled = (*reversed(range(n - 2)), n - 2, n - 1)
    whole = np.arange(n * n).reshape(n, n) + np.arange(n * n).reshape(n, n).T
    found = Posterior(tuple(names[k] for k in shuffled), np.array(shuffled), whole[np.ix_(shuffled, shuffled)]).in_order(effects)
    assert found.names == names
    np.testing.assert_array_equal(found.mean, np.arange(n))
    np.testing.assert_array_equal(found.covariance, whole)


def test_the_sdf_is_named_so_that_the_file_can_move_with_it(arm: RobotModel, tmp_path: Path) -> None:
    def said(path: Path, model: RobotModel) -> str:
        return str(yaml.safe_load(save_model(model, path).read_text())["robot"]["model"])

    assert said(tmp_path / "model.yaml", arm) == "robot.sdf"
    assert said(tmp_path / "out/model.yaml", arm) == str(tmp_path / "robot.sdf")
    assert said(tmp_path / "puppy.yaml", puppy_model()) == "package://puppy/puppy.sdf"
    assert load_model(tmp_path / "puppy.yaml").sha256 == puppy_model().sha256
    (tmp_path / "moved").mkdir()
    for name in ("robot.sdf", "model.yaml"):
        (tmp_path / name).rename(tmp_path / "moved" / name)
    assert load_model(tmp_path / "moved/model.yaml").path == tmp_path / "moved/robot.sdf"


def test_servos_alike_are_said_once(tmp_path: Path) -> None:
    model = load_session(write_session(tmp_path)).model
    said = yaml.safe_load(save_model(model, tmp_path / "model.yaml").read_text())
    assert said["servos"]["stall_torque"] == 1.5
    assert "effects" not in said
    assert load_model(tmp_path / "model.yaml").servos == model.servos


def test_another_drake_project_simulates_it_in_one_line(tmp_path: Path) -> None:
    save_model(puppy_model().with_effect(EffectSpec("backlash", ("flm",), {"gap": 3.0})), tmp_path / "model.yaml")
    station = MakeStation(load_model(tmp_path / "model.yaml"))
    assert station.plant().num_velocities() == 6 + 15 + 1  # the play is a joint of its own


@pytest.mark.parametrize(("old", "new", "expected"), [
    ("format: 1", "format: 2", "format: expected 1"),
    ("effect: backlash", "efect: backlash", "effects[0].efect: unknown key; expected one of effect, where, parameters"),
    ("gap: 3.1", "gap: wide", "effects[0].parameters.gap: expected a number"),
    ("gap: 3.1", "gap: .inf", "effects[0].parameters.gap: expected a number"),
    ("position: [0.01, 0.0, -0.02]", "position: [0.01, 0.0]", "effects[1].parameters.position: expected one number or three"),
    ("where: [two]", "where: [four]", "effects[0].where: the robot has no joint, link or rigid body 'four'"),
    ("where: [two]", "where: two", "effects[0].where: expected a list"),
    ("model: robot.sdf", "model: none.sdf", "robot.model: file not found"),
    ("base: trunk", "base: tronk", "robot.base: the model has no link 'tronk'"),
    ("stall_torque: 1.5", "stall_torque: -1", "servos: stall_torque: expected a positive number"),
    ("punch: 32", "punsh: 32", "servos: unknown key 'punsh'"),
    ("friction: 0.6", "friction: -1", "ground.friction: expected a non-negative number"),
    ("effects:", "colour: red\neffects:", "colour: unknown key"),
    ("posterior:", "posterior:\n  scale: 1", "posterior.scale: unknown key"),
    ("backlash(two).gap", "backlash(one).gap", "posterior.names: expected those of the effects"),
    ("mean: [3.1,", "mean: [3.1, 1,", "posterior.mean: expected a list of 6 numbers"),
])
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, expected: str) -> None:
    model = replace(load_session(write_session(tmp_path)).model, effects=EFFECTS, ground=Ground(friction=0.6))
    names = parameter_names(model.effects)
    path = save_model(model, tmp_path / "model.yaml", Posterior(names, np.array([3.1, 0, 0, 0, 0, 0]), np.eye(6)))
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_model(path)
    message = str(caught.value)
    assert message.startswith(str(path)), message
    assert expected in message, message
