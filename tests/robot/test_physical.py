"""Physical constants that a user gives: the impossible ones are refused, the unlikely ones told."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from tests.command import refused
from tests.inputs.corpus import ROBOT, SDF
from tests.inputs.corpus import SERVO as SERVO_FILE
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.gait.ensemble import load_ensemble
from workbench.inspect.problems import model_problems_of
from workbench.physical import GROUND, MASS, SERVO, TIME_STEP
from workbench.robot import Ground, RobotModel, load_model, load_servo_constants, puppy_model
from workbench.robot.law_covariance import LawCovariance
from workbench.robot.servo_constants import ServoConstants
from workbench.robot.torque_table import TorqueTable
from workbench.simulation import MakeStation, SimulationConfig


@pytest.mark.parametrize(("friction", "written", "said"), [
    (60.0, "60", "at most 5"), (6.0, "6.0", "at most 5"), (-0.1, "-0.1", "non-negative"), (math.nan, ".nan", "number"),
    (math.inf, ".inf", "number"), (True, "true", "number"), ("0.6", "'0.6'", "number")])
def test_a_friction_that_no_floor_has_is_refused_wherever_it_is_given(tmp_path: Path, friction: object, written: str,
                                                                      said: str) -> None:
    with pytest.raises(InputError, match=f"friction: expected .*{said}"):
        Ground(friction=friction)  # type: ignore[arg-type]
    path = tmp_path / "model.yaml"
    path.write_text(f"format: 1\nground: {{friction: {written}}}\n")
    with pytest.raises(InputError, match=r"model\.yaml: ground\.friction: expected"):
        load_model(path)
    path = tmp_path / "session.yaml"
    path.write_text(f"format: 1\nground: {{friction: {written}}}\ntakes: []\n")
    with pytest.raises(InputError, match=r"session\.yaml: ground\.friction: expected"):
        load_session(path)


def test_the_verb_refuses_it_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "model.yaml").write_text("format: 1\nrobot: {}\nground: {friction: 60}\n")
    said = refused(capsys, "inspect", str(tmp_path / "model.yaml"))
    assert said.endswith("model.yaml: ground.friction: expected at most 5, got 60")


FRICTION = "<surface><friction><ode><mu>{0}</mu><mu2>{0}</mu2></ode></friction></surface>"
DRAKE = '<drake:proximity_properties xmlns:drake="http://drake.mit.edu">{}</drake:proximity_properties>'


def _sdf(folder: Path, material: str) -> Path:
    (folder / "robot.sdf").write_text(SDF.replace("</geometry></collision>", f"</geometry>{material}</collision>"))
    return folder / "robot.sdf"


@pytest.mark.parametrize(("material", "said"), [
    (FRICTION.format("1e6"), "friction: expected at most 5, got 1e+06; correct it, or state the ground's own friction"),
    (DRAKE.format("<drake:mu_dynamic>7</drake:mu_dynamic>"), "friction: expected at most 5, got 7; correct it"),
    (DRAKE.format("<drake:mu_dynamic>a</drake:mu_dynamic>"), "mu_dynamic: expected finite numbers of a usual size, found 'a'"),
    (DRAKE.format("<drake:mu_static>nan</drake:mu_static>"), "mu_static: expected finite numbers of a usual size, found 'nan'"),
    (DRAKE.format("<drake:point_contact_stiffness>1e-3</drake:point_contact_stiffness>"),
     "point_contact_stiffness: expected at least 10 N/m, got 0.001"),
    (DRAKE.format("<drake:hunt_crossley_dissipation>1e9</drake:hunt_crossley_dissipation>"),
     "hunt_crossley_dissipation: expected at most 100000 s/m, got 1e+09")])
def test_a_material_that_no_foot_has_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], material: str, said: str
                                                ) -> None:
    path = _sdf(tmp_path, material)
    assert f"robot.sdf: link 'r': {said}" in refused(capsys, "inspect", str(path))
    with pytest.raises(InputError, match="link 'r'"):
        MakeStation(RobotModel(str(path)))


def test_a_material_of_a_urdf_is_checked_too(tmp_path: Path) -> None:
    for name, value, said in (("mu_dynamic", "abc", "mu_dynamic: expected finite numbers"),
                              ("mu_dynamic", "7", "friction: expected at most 5, got 7"),
                              ("point_contact_stiffness", "0", "point_contact_stiffness: expected at least 10 N/m")):
        material = DRAKE.format(f'<drake:{name} value="{value}"/>')
        (tmp_path / "robot.urdf").write_text(ROBOT.replace("</geometry></collision>", f"</geometry>{material}</collision>"))
        with pytest.raises(InputError, match=rf"robot\.urdf: link 'trunk': {said}"):
            _ = RobotModel(str(tmp_path / "robot.urdf")).problems


def test_the_ground_of_a_session_replaces_a_friction_that_no_foot_has(tmp_path: Path) -> None:
    model = RobotModel(str(_sdf(tmp_path, FRICTION.format("1e6"))), ground=Ground(friction=0.6))
    assert model.problems == ()
    assert MakeStation(model).plant().num_actuators() == 1
    assert MakeStation(replace(model, ground=Ground()), SimulationConfig(base="fixed")).plant().num_actuators() == 1


def test_an_unlikely_friction_of_a_foot_is_told(tmp_path: Path) -> None:
    (told,) = RobotModel(str(_sdf(tmp_path, FRICTION.format("3")))).problems
    assert told.startswith("link 'r': friction: 3 is more than feet on floors have (1.5)")


def test_ensembles_draw_only_what_an_effect_can_have(tmp_path: Path) -> None:
    path = tmp_path / "ensemble.yaml"
    path.write_text("format: 1\nfriction: {low: 30, high: 90}\n")
    with pytest.raises(InputError, match=r"ensemble\.yaml: friction\.low: expected 0\.02 to 1\.5, got 30"):
        load_ensemble(path)
    path.write_text("format: 1\nsupply_voltage: {low: 9.6, high: 111}\n")
    with pytest.raises(InputError, match=r"supply_voltage\.high: expected 3 to 20 V, got 111"):
        load_ensemble(path)


@pytest.mark.parametrize(("ground", "said"), [
    (Ground(friction=3.0), "ground.friction: 3 is more than"), (Ground(friction=0.001), "ground.friction: 0.001 is less than"),
    (Ground(stiffness=50.0), "ground.stiffness: 50 N/m is less than"),
    (Ground(dissipation=5e3), "ground.dissipation: 5000 s/m is more")])
def test_an_unlikely_floor_is_told(ground: Ground, said: str) -> None:
    (told,) = [text for text in model_problems_of(puppy_model(ground=ground)) if "ground" in text]
    assert told.startswith(said)


def test_likely_floors_are_not() -> None:
    for ground in (Ground(), Ground(0.6, 1e5, 20.0), Ground(friction=1.2, stiffness=math.inf), Ground(0.05, 1e9, 0.0)):
        assert ground.doubts == ()


@pytest.mark.parametrize("name", list(SERVO))
def test_bounds_of_servos_enclose_the_likely_ones(name: str) -> None:
    r = SERVO[name]
    assert r.least <= max(r.low, r.least) < min(r.high, r.most) <= r.most


def test_a_servo_that_its_own_friction_holds_is_told() -> None:
    (told,) = ServoConstants(coulomb_friction=1.45).doubts
    assert "coulomb_friction: 1.45 N m holds the servo against its whole torque (1.39 N m at 11.1 V)" in told


def test_steps_and_masses() -> None:
    with pytest.raises(InputError, match=r"time_step: expected at most 0\.01 s, got 0\.5"):
        SimulationConfig(time_step=0.5)
    assert TIME_STEP.problem(1e-3) is None
    assert MASS.problem(200.0) == "expected at most 5 kg, got 200"
    assert GROUND["stiffness"].problem(math.inf) is None
    assert GROUND["stiffness"].problem(5.0) == "expected at least 10 N/m, got 5"


def test_a_torque_that_no_servo_bears_is_refused_in_tables() -> None:
    with pytest.raises(InputError, match=r"torque: expected at most 200 N m, got 2000"):
        TorqueTable("angle", (0.0, 1.0), (0.0, -2000.0))
    assert TorqueTable("angle", (0.0, 1.0), (0.0, -0.01)).torque == (0.0, -0.01)


def test_a_standard_deviation_beyond_its_value_is_told(tmp_path: Path) -> None:
    (tmp_path / "servo.yaml").write_text(SERVO_FILE.replace("supply_voltage: 11.1", "supply_voltage: {value: 11.1, sd: 1000}"))
    (told,) = load_servo_constants(tmp_path / "servo.yaml").doubts
    assert told.startswith("supply_voltage: sd 1000 is more than 3 times its value")


def test_a_constant_of_which_nothing_is_known_is_refused(tmp_path: Path) -> None:
    given = "supply_voltage: {value: 11.1, sd: 1.0e+30}"
    (tmp_path / "servo.yaml").write_text(SERVO_FILE.replace("supply_voltage: 11.1", given))
    with pytest.raises(InputError, match=r"supply_voltage: sd: expected at most 100 times the value, got 1e\+30"):
        load_servo_constants(tmp_path / "servo.yaml")
    with pytest.raises(InputError, match=r"covariance: expected variances of at most 10000, got 1e\+30"):
        LawCovariance(("back_emf",), ((1e30,),))
