"""Takes of one session with known weights on the robot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

from tests.servo_rig import SDF
from workbench.compare.session import load_session
from workbench.effects.apply import physics_of
from workbench.files import InputError
from workbench.recording import write_joint_log
from workbench.recording.formats.log_commands import commands_of_rows
from workbench.robot import ServoConstants
from workbench.simulation import Job, SimulationConfig
from workbench.simulation.batch import run_job

SERVO = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=2.0, coulomb_friction=0.0)


def session(folder, **takes):
    (folder / "rig.sdf").write_text(SDF.format(length=0.1, mass=0.2))
    (folder / "servo.yaml").write_text(yaml.safe_dump(SERVO.as_dict()))
    time = np.arange(0.0, 1.0, 0.01)
    write_joint_log(folder / "log.csv", time, {"goal.j": 0 * time + 0.5, "position.j": 0 * time})
    entries = [{"name": name, "recording": "log.csv", "base": "fixed"} | more for name, more in takes.items()]
    (folder / "session.yaml").write_text(yaml.safe_dump(
        {"format": 1, "robot": {"model": "rig.sdf", "base": "base", "servos": "servo.yaml"}, "takes": entries}))
    return load_session(folder)


def test_an_arm_hangs_lower_by_the_weight_that_a_take_declares(tmp_path):
    s = session(tmp_path, bare={}, loaded={"load": {"link": "arm", "mass": 0.3, "at": [0, 0, -0.15]}})
    goal = 0.5
    commands = commands_of_rows(np.array([0.0, 2.0]), ("j",), np.full((2, 1), goal))
    stiffness, config = SERVO.gain * SERVO.torque_at_full_duty, SimulationConfig(base="fixed", contact_period=0, settle=0.1)
    for take, moment in zip(s.takes, (0.2 * 0.1, 0.2 * 0.1 + 0.3 * 0.15)):
        q = run_job(Job(s.model_of(take), replace(config, engine="drake"), commands, 2.0)).q[-1, 0]
        assert stiffness * (goal - q) == pytest.approx(moment * 9.81 * np.sin(q), rel=2e-3)
    assert s.takes[0].conditions != s.takes[1].conditions
    assert physics_of(s.model).description is None  # the robot itself carries nothing


@pytest.mark.parametrize(("load", "expected"), [
    ({"link": "leg", "mass": 0.2, "at": [0, 0, 0]}, r"load\.link"), ({"link": "arm", "at": [0, 0, 0]}, r"load\.mass"),
    ({"link": "arm", "mass": -1, "at": [0, 0, 0]}, r"load\.mass"), ({"link": "arm", "mass": 0.2, "at": [0, 0]}, "three numbers"),
    ({"link": "arm", "mass": 0.2, "at": [0, 0, 15]}, "three numbers"),
    ({"link": "arm", "mass": 0.2, "at": [0, 0, 0], "x": 1}, r"load\.x")])
def test_a_load_that_cannot_be_is_said(tmp_path, load, expected):
    with pytest.raises(InputError, match=expected):
        session(tmp_path, loaded={"load": load})
