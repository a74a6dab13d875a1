"""The study of speed against torque, on certificates that are there."""

import json

import pytest

from studies import gait_front
from studies.common import run_study
from workbench.gait.certificate import NAME


def certificate(speed, torque, kept=True):
    """What the study reads of one."""
    return {"kept": kept, "nominal": {"speed": speed, "RMS torque N m": {"tail": torque, "flb": 0.5 * torque}},
            "draws": {"speed m/s": [0.1, 0.5 * speed, speed, speed, speed], "falls": 0, "count": 64, "heading deg/m RMS": 9.0,
                      "largest RMS torque N m": [torque] * 5}}


def test_gaits_on_the_front_are_those_that_no_other_outdoes(tmp_path, monkeypatch):
    found = {0.10: (0.12, 0.20, True), 0.20: (0.21, 0.35, True), 0.30: (0.20, 0.40, True), 0.40: (0.5, 0.21, False)}
    monkeypatch.setattr(gait_front, "SPEEDS", tuple(found))
    for asked, of in found.items():
        folder = tmp_path / "front" / f"{asked:.2f}"
        folder.mkdir(parents=True)
        (folder / NAME).write_text(json.dumps(certificate(*of)))
    assert run_study("gait_front", gait_front.__doc__, gait_front.study, ["--out", str(tmp_path)]) == 0
    page, numbers = (tmp_path / "index.html").read_text(), json.loads((tmp_path / "numbers.json").read_text())
    assert "0.20 N m at 0.12 m/s; 0.35 N m at 0.21 m/s." in page  # the third goes less far for more, the fourth breaks a limit
    assert [g["joint"] for g in numbers["gaits"]] == ["tail"] * 4
    speed, torque = numbers["ROBOTIS walk"]
    assert speed == pytest.approx(0.02, abs=0.02)
    assert torque > gait_front.RULE  # its tail works beyond a fifth of stall
    assert (tmp_path / "front.png").stat().st_size > 10_000
