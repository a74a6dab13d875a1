"""Servo logs of a one-joint rig, from files to findings: what was put in is named, and what is only calibration is not."""

import json

import numpy as np
import pytest
import yaml

from tests.servo_rig import SDF
from workbench.compare.session import load_session
from workbench.identify.diagnosis import diagnose_session
from workbench.recording import write_joint_log
from workbench.recording.formats.log_commands import commands_of_rows
from workbench.robot import EffectSpec, load_model
from workbench.simulation import Job, SimulationConfig, simulate_batch

SERVO = {"stall_torque": 0.7, "no_load_speed": 19.0, "rated_voltage": 7.4, "supply_voltage": 7.4, "coulomb_friction": 0.013,
         "viscous_friction": 0.004, "reflected_inertia": 0.0018, "proportional_gain": 1.15}
GAINS = (0.3, 0.6, 1.2)
pytestmark = pytest.mark.slow
NOISE = 1.5e-3


def record(folder, effects=(), **servo):
    """A session of three logs of 3 s, one a gain, of a rig with other physics than its servo.yaml says."""
    (folder / "rig.sdf").write_text(SDF.format(length=0.1, mass=0.5))
    (folder / "servo.yaml").write_text(yaml.safe_dump(SERVO))
    takes = [{"name": f"gain {g:g}", "recording": f"{g:g}.csv", "base": "fixed", "servos": {"proportional_gain": g}}
             for g in GAINS]
    (folder / "session.yaml").write_text(yaml.safe_dump(
        {"format": 1, "robot": {"model": "rig.sdf", "base": "base", "servos": "servo.yaml"}, "takes": takes}))
    time = np.arange(0.0, 3.0, 0.01)
    goal = 1.1 * np.sin(2.2 * time) + 0.5 * np.sin(7.0 * time + 1.0)
    for g in GAINS:  # so that the session can be read
        write_joint_log(folder / f"{g:g}.csv", time, {"goal.j": goal, "position.j": 0 * goal})
    model = load_session(folder).model
    jobs = []
    for g in GAINS:
        robot = model.with_servos({"proportional_gain": g} | servo)
        for spec in effects:
            robot = robot.with_effect(spec)
        commands = commands_of_rows(time, ("j",), goal[:, None], np.ones((len(time), 1), dtype=bool))
        jobs.append(Job(robot, SimulationConfig(base="fixed", contact_period=0, settle=0.1), commands, 3.0, 0.0, times=time))
    for k, (g, take) in enumerate(zip(GAINS, simulate_batch(jobs, n_jobs=1))):
        noise = np.random.default_rng(k).normal(size=len(time)) * NOISE
        q = np.interp(time, take.time, np.nan_to_num(take.as_logged().q[:, 0])) + noise
        write_joint_log(folder / f"{g:g}.csv", time, {"goal.j": goal, "position.j": q})
    return load_session(folder)


def test_load_friction_is_named_with_its_family(tmp_path):
    told = diagnose_session(record(tmp_path, [EffectSpec("load_friction", ("j",), {"coefficient": 0.5})]), n_jobs=1)
    (finding, *others) = told.diagnosis.findings
    assert (finding.effect, finding.where) == ("load_friction", ("j",))
    assert finding.confidence > 0.9
    assert finding.family.name == "friction"
    assert finding.family.confidence > 0.9
    assert finding.parameters["coefficient"].value == pytest.approx(0.5, abs=0.12)
    assert all(f.confidence < 0.9 for f in others)
    assert finding.validation.after < 0.5 * finding.validation.before
    said = json.loads(json.dumps(told.diagnosis.to_json(), allow_nan=False))
    assert said["findings"][0]["family"]["name"] == "friction"
    told.diagnosis.save(tmp_path / "out")
    assert load_model(tmp_path / "out" / "model.yaml").effects == told.diagnosis.model.effects


def test_a_weaker_motor_within_what_is_known_is_recalibrated_and_no_finding(tmp_path):
    told = diagnose_session(record(tmp_path, supply_voltage=6.8), n_jobs=1)
    assert all(f.confidence < 0.5 for f in told.diagnosis.findings)
    changed = {r.number: r for r in told.diagnosis.recalibrated}
    assert changed["torque_at_full_duty"].value / changed["torque_at_full_duty"].nominal == pytest.approx(6.8 / 7.4, rel=0.04)
