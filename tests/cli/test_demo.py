"""The demo end to end."""

import json
from pathlib import Path

import pytest

from tests.command import succeeds
from workbench.api.demo import page as demo


@pytest.mark.slow
def test_demo(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = succeeds(capsys, "demo", "--out", str(tmp_path / "demo"))
    for name, *values in demo.THESIS:
        assert name in said
        assert all(f"{v:.2f}" in said for v in values)
    assert said.count("servo law") == said.count("ideal joints") == 2
    assert said.rstrip().endswith(f"open {tmp_path}/demo/report.html")
    written = {p.relative_to(tmp_path / "demo").as_posix() for p in (tmp_path / "demo").rglob("*") if p.is_file()}
    assert "diagnosis of the bundled arm: " in said
    findings = json.loads((tmp_path / "demo/diagnosis/findings.json").read_text())["findings"]
    assert [(f["effect"], f["where"]) for f in findings] == [("coulomb_friction", ["elbow"])]
    assert {"report.html", "comparison.json", "firmware/pos.txt", "replay-walk.html", "servo_law-point.csv"} <= written
    goals = (tmp_path / "demo/firmware/pos.txt").read_text().splitlines()[2]
    assert goals == "412,482,532,722,632,552,762,642,512,412,442,492,512,442,522,"  # the contract's figures
