"""Slips in names: caught where they are made, with the name that was meant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import workbench
from tests.command import main, refused
from tests.inputs.corpus import ROBOT, joint_log, swing


@pytest.fixture
def robot(tmp_path: Path) -> workbench.RobotModel:
    (tmp_path / "leg.urdf").write_text(ROBOT)
    return workbench.load_model(tmp_path / "leg.urdf")


def test_an_effect_at_no_part_of_the_robot_is_refused_where_it_is_added(robot: workbench.RobotModel) -> None:
    with pytest.raises(workbench.InputError, match=r"the robot has no 'Kne'; did you mean knee\?"):
        robot.with_effect(workbench.EffectSpec("backlash", ("Kne",), {"gap": 2.0}))
    with pytest.raises(workbench.InputError, match=r"expected a tuple of names, as \('knee',\)"):
        workbench.EffectSpec("backlash", "knee", {"gap": 2.0})  # type: ignore[arg-type]


@pytest.mark.parametrize(("effect", "parameters", "said"), [
    ("backlsh", {"gap": 2.0}, "backlsh"),
    ("backlash", {"gab": 2.0}, "parameter .gap. .deg. is missing"),
    ("backlash", {"gap": -2.0}, "gap")])
def test_a_model_with_an_impossible_effect_is_not_saved(robot: workbench.RobotModel, tmp_path: Path, effect: str,
                                                       parameters: dict[str, float], said: str) -> None:
    wrong = robot.with_effect(workbench.EffectSpec(effect, ("knee",), parameters))
    with pytest.raises(workbench.InputError, match=said):
        workbench.save_model(wrong, tmp_path / "model.yaml")
    assert not (tmp_path / "model.yaml").exists()
    right = robot.with_effect(workbench.EffectSpec("backlash", ("knee",), {"gap": 2.0}))
    assert workbench.load_model(workbench.save_model(right, tmp_path / "model.yaml")).effects == right.effects



def test_a_session_that_verbs_would_refuse_is_no_success(robot: workbench.RobotModel, tmp_path: Path,
                                                          capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "session.yaml"
    path.write_text("format: 1\nrobot: {model: leg.urdf}\ntakes:\n- {name: one, recording: log.csv, base: fixed}\n")
    (tmp_path / "log.csv").write_text(joint_log(*swing(), joint="kne"))
    assert "did you mean knee?" in refused(capsys, "inspect", str(path))
    (tmp_path / "log.csv").write_text(joint_log(*swing(), joint="knee"))
    assert main(["inspect", str(path)]) == 0
    (tmp_path / "log.csv").write_text(joint_log(*swing(), joint="knee")[:60])
    assert "none of its takes can be used" in refused(capsys, "inspect", str(path))


def test_a_notebook_shows_robots_and_motions_as_tables(robot: workbench.RobotModel) -> None:
    shown = robot._repr_html_()
    assert "<td>knee</td><td>shank</td>" in shown
    assert "2 joints; effects: none" in shown
    motion = workbench.Motion("<b>", np.array([0.0, 0.5]), ("knee",), np.array([[0.0], [0.5]]))
    assert "&lt;b&gt;: 1 poses in 0.50 s; the last pose is not the first" in motion._repr_html_()
    assert "<td>28.6</td>" in motion._repr_html_()
