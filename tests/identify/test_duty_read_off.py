"""Logs whose register of duty shows another gain, delay or clock than the session tells: findings before any rollout."""

import json

import pytest
import yaml

from studies.sts3215.sessions import RIGS, SERVO
from tests.gap_sessions import write_session
from tests.recording.test_how_logged import as_register, servo_log
from tests.servo_rig import rig_model
from workbench.compare.logged import register_laws
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes
from workbench.identify.estimators.registers import read_off_duty, read_off_registers
from workbench.recording.servo_log.duty_register import RegisterLaw
from workbench.robot import ServoConstants

GAIN = 2.6


def session(folder, told):
    (folder / "robot.sdf").write_text(RIGS["arm150_0.741kg"].sdf)
    (folder / "servo.yaml").write_text(yaml.safe_dump(SERVO | {"proportional_gain": told * GAIN}))
    takes = []
    for seed in range(3):
        rows = zip(*(x.tolist() for x in servo_log(GAIN, seed)))
        entries = [{"timestamp": t, "goal_position": goal, "position": q, "torque": float(as_register(duty)), "load": 0,
                    "torque_enable": True} for t, goal, q, duty in rows]
        (folder / f"{seed}.json").write_text(json.dumps({"motor": "servo", "entries": entries}))
        takes.append({"name": f"log_{seed}", "recording": f"{seed}.json", "base": "fixed"})
    content = {"format": 1, "robot": {"model": "robot.sdf", "base": "stand", "servos": "servo.yaml"}, "takes": takes}
    (folder / "session.yaml").write_text(yaml.safe_dump(content))
    return load_session(folder)


@pytest.mark.parametrize(("told", "true"), [(2.0, 0.5), (0.5, 2.0)])
def test_a_gain_told_wrong_is_read_from_the_duty(tmp_path, told, true):
    s = session(tmp_path, told)
    (measured,) = read_off_registers(s, register_laws(read_takes(s)[0]))
    assert (measured.effect, measured.where) == ("servo_gain", "servo")
    assert measured.mean == pytest.approx(true, abs=2 * measured.sigma)
    assert "register of duty" in measured.seen
    assert "the servo's register" in measured.seen


def test_a_gain_told_right_is_no_finding_and_one_that_the_model_has_is_not_found_again(tmp_path):
    s = session(tmp_path, 1.0)
    assert read_off_registers(s, register_laws(read_takes(s)[0])) == ()
    s = session(tmp_path, 2.0)
    (measured,) = read_off_registers(s, register_laws(read_takes(s)[0]))
    known = s.with_model(s.model.with_effects((measured.spec,)))
    assert read_off_registers(known, register_laws(read_takes(known)[0])) == ()


SD = {"gain": 0.001, "delay": 1e-4, "rate": 1e-5}


def law(gain=1.0, delay=0.0, rate=1.0):
    return RegisterLaw(gain, delay, 5.0, 0.01, 0.001, rate, 0.001, SD)


@pytest.mark.parametrize(("shown", "found"), [
    (law(), {}), (law(1.1), {}), (law(0.5), {"servo_gain": 0.5}), (law(1.3), {"servo_gain": 1.3}),
    (law(delay=0.005), {}), (law(delay=0.04), {"command_delay": 0.04}), (law(delay=-0.04), {}),
    (law(rate=1.003), {}), (law(rate=1.01), {"clock_rate": 1.01})])
def test_an_effect_is_found_only_beyond_the_error_of_the_law_behind_it(tmp_path, shown, found):
    model = rig_model(tmp_path, ServoConstants())
    assert {m.effect: m.mean for m in read_off_duty(model, {"j": shown})} == pytest.approx(found)


def test_a_delay_is_one_beyond_what_the_servo_has_as_well_as_that_is_known(tmp_path):
    known = ServoConstants(goal_delay=0.02, sd=(("goal_delay", 0.001),))
    (measured,) = read_off_duty(rig_model(tmp_path, known), {"j": law(delay=0.06)})
    assert measured.mean == pytest.approx(0.04)
    unsure = ServoConstants(goal_delay=0.02, sd=(("goal_delay", 0.01),))
    assert read_off_duty(rig_model(tmp_path, unsure), {"j": law(delay=0.06)}) == []


def test_joints_that_agree_share_one_clock_and_one_delay(tmp_path):
    (tmp_path / "session.yaml").write_text("")
    model = load_session(write_session(tmp_path)).model
    late = {joint: law(delay=0.04, rate=1.01) for joint in model.joints}
    assert {(m.effect, m.places) for m in read_off_duty(model, late)} == {("command_delay", ()), ("clock_rate", ())}
    assert all("the servos' registers" in m.seen for m in read_off_duty(model, late))
    found = read_off_duty(model, late | {"two": law()})
    assert {(m.effect, m.where) for m in found} == {("command_delay", j) for j in model.joints if j != "two"}
