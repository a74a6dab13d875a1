"""Logs of servos that do what no effect says: read, and diagnosed in minutes without a claim that all is explained."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import pytest

from tests.command import succeeds
from tests.inputs.other_makers import PWM, bus_session, pwm_session

LONGEST = 300.0  # s of processor


def test_a_bus_servos_logs_are_read_and_their_lack_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bus_session(tmp_path, 2.0)
    said = succeeds(capsys, "inspect", str(tmp_path))
    assert said.count("load is 0 in every row") == 3
    assert said.count("problem:") == 3


@pytest.mark.slow
def test_a_pwm_servo_is_diagnosed_in_minutes_and_not_called_explained(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pwm_session(tmp_path)
    began = time.process_time()
    succeeds(capsys, "diagnose", str(tmp_path), "--out", str(tmp_path / "out"), "--jobs", "1")
    assert time.process_time() - began < LONGEST
    said = json.loads((tmp_path / "out" / "findings.json").read_text())
    assert said["verdict"] == "partly_explained"
    numbers = {f["effect"]: f["parameters"] for f in said["findings"]}
    if "supply_voltage" in numbers:  # 17.9 V would be the likeliest, and burn it
        assert numbers["supply_voltage"]["voltage"]["value"] < 1.5 * 6.8
    if "com_shift" in numbers:  # 95 mm likewise, and no rod of 170 mm has it there
        assert np.linalg.norm(numbers["com_shift"]["offset"]["value"]) < 0.5 * PWM.length
