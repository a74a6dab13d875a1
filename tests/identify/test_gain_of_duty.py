"""A log whose register of duty shows another gain than the session tells: a finding before any rollout."""

import json

import pytest
import yaml

from studies.sts3215.sessions import RIGS, SERVO
from tests.recording.test_how_logged import as_register, servo_log
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes
from workbench.identify.estimators.registers import gains_of_duty, read_off_registers
from workbench.recording.servo_log.duty_register import RegisterLaw

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
    (measured,) = read_off_registers(s, read_takes(s)[0])
    assert (measured.effect, measured.where) == ("servo_gain", "servo")
    assert measured.mean == pytest.approx(true, abs=2 * measured.sigma)
    assert "register of duty" in measured.seen


def test_a_gain_told_right_is_no_finding_and_one_that_the_model_has_is_not_found_again(tmp_path):
    s = session(tmp_path, 1.0)
    assert read_off_registers(s, read_takes(s)[0]) == ()
    s = session(tmp_path, 2.0)
    (measured,) = read_off_registers(s, read_takes(s)[0])
    known = s.with_model(s.model.with_effects((measured.spec,)))
    assert read_off_registers(known, read_takes(known)[0]) == ()


@pytest.mark.parametrize(("gain", "sd", "found"), [(1.1, 0.001, 0), (0.5, 0.2, 0), (1.3, 0.001, 1)])
def test_a_gain_is_found_only_beyond_the_error_of_the_law_behind_it(gain, sd, found):
    law = RegisterLaw(gain, 0.02, 5.0, 0.01, 0.001, 0.001, {"gain": sd})
    assert len(gains_of_duty({"servo": law})) == found
