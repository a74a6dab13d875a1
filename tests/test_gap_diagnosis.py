"""A diagnosis from session to findings, on a small arm."""

import json

import pytest

from tests.gap_sessions import record_arm
from workbench.cli.main import main
from workbench.gap.diagnosis import diagnose_session
from workbench.gap.session import load_session
from workbench.robot import load_model


def test_a_quiet_robot_has_no_gap(tmp_path):
    record_arm(tmp_path)
    told = diagnose_session(load_session(tmp_path / "session.yaml"), n_jobs=1)
    assert told.diagnosis.verdict == "no_gap"
    assert told.diagnosis.findings == ()
    assert told.diagnosis.model.effects == ()


@pytest.mark.slow
def test_a_worn_joint_is_named_placed_and_sized_and_its_rivals_told(tmp_path):
    record_arm(tmp_path, friction=0.14)
    assert main(["diagnose", str(tmp_path / "session.yaml"), "--out", str(tmp_path / "out")]) == 0
    found = json.loads((tmp_path / "out/findings.json").read_text())
    assert found["verdict"] == "explained"
    assert found["gap"][0]["where"] == ["three"]
    finding, = found["findings"]
    named = [finding["effect"], *(a["effect"] for a in finding["alternatives"])]
    assert "coulomb_friction" in named
    assert finding["where"] == ["three"]
    assert finding["validation"]["after"] < 0.5 * finding["validation"]["before"]
    assert any(r["effect"] in ("viscous_friction", "dead_band", "servo_gain", "stribeck_friction") for r in found["rejected"])
    assert load_model(tmp_path / "out/model.yaml").effects[0].where == ("three",)
    assert (tmp_path / "out/report.html").stat().st_size > 100_000
