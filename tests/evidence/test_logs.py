"""Servo logs of a one-joint rig, from files to findings: hidden effects are named, deviations within the calibration are not."""

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


def test_a_friction_far_below_the_nominal_one_is_named_and_one_as_large_is_not(tmp_path):
    """Of 0.16 N m, the recalibration reaches 0.036 N m, three standard deviations away."""
    for hidden, folder in ((0.013, tmp_path / "less"), (0.16, tmp_path / "as told")):
        folder.mkdir()
        told = diagnose_session(record(folder, told={"coulomb_friction": 0.16}, coulomb_friction=hidden), n_jobs=1).diagnosis
        named = {f.effect: f for f in told.findings if f.confidence > 0.5}
        if hidden == 0.16:
            assert not named
            continue
        assert set(named) == {"coulomb_friction"}
        changed = {r.number: r.value - r.nominal for r in told.recalibrated}
        less = named["coulomb_friction"].parameters["torque"].value
        assert less < -0.03
        assert less + changed["coulomb_friction"] == pytest.approx(-0.147, abs=0.004)
        assert "less dry friction" in named["coulomb_friction"].evidence
        told.save(folder / "out")
        assert load_model(folder / "out" / "model.yaml").effects == told.model.effects


def test_a_weaker_motor_within_what_is_known_is_recalibrated_and_no_finding(tmp_path):
    told = diagnose_session(record(tmp_path, supply_voltage=6.8), n_jobs=1)
    assert all(f.confidence < 0.5 for f in told.diagnosis.findings)
    changed = {r.number: r for r in told.diagnosis.recalibrated}
    assert changed["torque_at_full_duty"].value / changed["torque_at_full_duty"].nominal == pytest.approx(6.8 / 7.4, rel=0.04)
