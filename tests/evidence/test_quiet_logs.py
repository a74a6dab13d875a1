"""Servo logs without a gap: the law is calibrated, and no effect is looked for."""

from tests.evidence.rig_logs import record
from workbench.identify.diagnosis import diagnose_session


def test_logs_without_a_gap_are_not_searched(tmp_path):
    asked = []
    told = diagnose_session(record(tmp_path), lambda what, share: asked.append(what), n_jobs=1).diagnosis
    assert told.verdict == "no_gap"
    assert told.findings == told.gap == ()
    assert told.recalibrated
    assert told.provenance["rollouts"] < 1500
    assert not any("effects" in what for what in asked)
