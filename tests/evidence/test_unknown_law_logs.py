"""Servo logs of a rig with a torque that no effect describes: reported with its curve and without a wrong name."""

import json

import numpy as np
import pytest

from tests.evidence.rig_logs import record
from workbench.identify.diagnosis import diagnose_session
from workbench.robot import load_model
from workbench.robot.torque_table import TorqueTable

pytestmark = pytest.mark.slow

ANGLES = np.linspace(-120.0, 120.0, 161)
COGGING = TorqueTable("angle", tuple(ANGLES), tuple(0.08 * np.sin(7 * np.radians(ANGLES))))


def test_cogging_is_an_unknown_torque_and_no_name(tmp_path):
    told = diagnose_session(record(tmp_path, torque_tables=(COGGING,)), n_jobs=1).diagnosis
    assert all(f.confidence < 0.5 for f in told.findings)
    (unknown,) = told.unknown_torques
    assert unknown.confidence > 0.9
    assert unknown.depends_on == ("angle",)
    assert unknown.rms == pytest.approx(0.08 / np.sqrt(2), rel=0.25)
    assert unknown.validation.after < 0.2 * unknown.validation.before
    assert told.verdict in ("unexplained", "partly_explained")
    assert json.loads(json.dumps(told.to_json(), allow_nan=False))["unknown_torques"][0]["joint"] == "j"
    told.save(tmp_path / "out")
    assert load_model(tmp_path / "out" / "model.yaml").servo("j").torque_tables == told.model.servo("j").torque_tables
