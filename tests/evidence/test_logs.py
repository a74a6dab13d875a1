"""Servo logs of a one-joint rig, from files to findings: what was put in is named, and what is only calibration is not."""

import json

import pytest

from tests.evidence.rig_logs import record
from workbench.identify.diagnosis import diagnose_session
from workbench.robot import EffectSpec, load_model

pytestmark = pytest.mark.slow


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
