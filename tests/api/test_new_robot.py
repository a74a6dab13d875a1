"""A session for a robot of one's own: written, complete, and never over files that are there."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.command import main
from tests.inputs.corpus import ROBOT, joint_log, swing
from workbench.api.new_robot import known_servos, new_robot, servo_types
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.robot import load_servo_constants


@pytest.fixture
def leg(tmp_path: Path) -> Path:
    (tmp_path / "leg.urdf").write_text(ROBOT)
    (tmp_path / "take.csv").write_text(joint_log(*swing(), joint="knee"))
    return tmp_path


@pytest.mark.parametrize("servo", ["LX-16A", "sts3250", "XL-430", "DS3218"])
def test_what_is_written_is_a_session(leg: Path, servo: str) -> None:
    made = new_robot(leg / "leg.urdf", servo, leg / "own", [leg / "take.csv"], "fixed")
    session = load_session(leg / "own")
    assert session.model.joints == ("hip", "knee")
    assert session.model.servo("knee").model == servo
    assert [t.name for t in session.takes] == ["take"]
    assert any("trunk" in line for line in made.guessed)
    assert any(line.startswith("bus_ids") for line in made.missing)


def test_the_makers_figures_arrive(leg: Path) -> None:
    new_robot(leg / "leg.urdf", "XL-320", leg)
    servo = load_servo_constants(leg / "servo.yaml")
    assert servo.stall_torque == pytest.approx(0.39, abs=0.002)
    assert servo.no_load_speed == pytest.approx(11.94, abs=0.05)
    assert "feet: [shank]" in (leg / "session.yaml").read_text()


def test_joints_beyond_the_servos_range_are_named(leg: Path) -> None:
    made = new_robot(leg / "leg.urdf", "SCS15", leg)  # 110 deg each side; the knee goes to 2 rad
    assert any(line.startswith("limits of knee") for line in made.missing)


def test_every_servo_has_a_source_and_a_name() -> None:
    assert {"LX-16A", "STS3032", "STS3250", "SCS15", "XL-320", "MX-28", "DS3218"} <= set(known_servos())
    assert all(len(of["source"]) > 10 for of in servo_types().values())


@pytest.mark.parametrize("name", ["null", "true", "No", "on", "Off"])
def test_names_that_yaml_takes_for_something_else_are_quoted(leg: Path, name: str) -> None:
    take = leg / f"{name}.csv"
    take.write_text((leg / "take.csv").read_text())
    new_robot(leg / "leg.urdf", "LX-16A", leg / "own", [take], "fixed")
    assert [t.name for t in load_session(leg / "own").takes] == [name]


def test_what_cannot_be_written_is_one_line(leg: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match=r"unknown servo 'LX16'; expected one of .*LX-16A"):
        new_robot(leg / "leg.urdf", "LX16", leg)
    assert not (leg / "session.yaml").exists()
    assert main(["new-robot", str(leg / "leg.urdf"), "--servo", "LX-16A", "--out", str(leg)]) == 0
    assert "left for you" in capsys.readouterr().out
    assert main(["new-robot", str(leg / "leg.urdf"), "--servo", "LX-16A", "--out", str(leg)]) == 2
    assert "already there" in capsys.readouterr().err


@pytest.mark.parametrize(("text", "said"), [
    (None, "file not found"), ("a poem", "not a recording"), (joint_log(*swing(), joint="wing"), "unknown joint 'wing'")])
def test_a_take_that_no_verb_could_use_is_refused(leg: Path, text: str | None, said: str) -> None:
    if text is not None:
        (leg / "other.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        new_robot(leg / "leg.urdf", "LX-16A", leg / "own", [leg / "take.csv", leg / "other.csv"], "fixed")
    assert not (leg / "own").exists()


def test_takes_of_one_name_are_told_apart(leg: Path) -> None:
    (leg / "second").mkdir()
    (leg / "second/take.csv").write_text((leg / "take.csv").read_text())
    new_robot(leg / "leg.urdf", "LX-16A", leg / "own", [leg / "take.csv", leg / "second/take.csv"], "fixed")
    assert [t.name for t in load_session(leg / "own").takes] == ["take", "take_2"]
