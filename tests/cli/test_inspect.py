"""`inspect` says what any file of the workbench is."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.command import main, refused, succeeds
from tests.gap_sessions import MOTION, record_arm, write_session
from tests.shared_data import shared
from workbench.robot import data_file


def _inspected(capsys: pytest.CaptureFixture[str], file: Path | str) -> dict:
    return json.loads(succeeds(capsys, "inspect", str(file), "--json"))


def test_motion(capsys: pytest.CaptureFixture[str]) -> None:
    said = _inspected(capsys, data_file("robotis_walk.csv"))
    assert (said["kind"], said["units"], said["problems"]) == ("motion", "deg, s", [])
    assert len(said["joints"]) == 15
    assert said["details"]["poses"] == 4


def test_motion_that_the_registers_cannot_hold(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "wide.csv").write_text("time,neck\n0,0\n1,170\n")
    problems = _inspected(capsys, tmp_path / "wide.csv")["problems"]
    assert any("neck" in p and "1092" in p for p in problems)  # 512 + round(170 · 1023/300)
    assert any("jumps" in p for p in problems)


def test_model_by_url(capsys: pytest.CaptureFixture[str]) -> None:
    said = _inspected(capsys, "package://puppy/puppy.sdf")
    assert (said["kind"], said["details"]["root"], len(said["joints"])) == ("model", "body_link", 15)


def test_session_and_what_it_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = write_session(tmp_path)
    assert main(["inspect", str(session), "--json"]) == 2  # its only take is no recording
    said = json.loads(capsys.readouterr().out)
    assert (said["kind"], said["details"]["takes"], said["joints"]) == ("session", ["wave"], ["one", "three", "two"])
    assert _inspected(capsys, tmp_path / "servo.yaml")["kind"] == "servo_constants"
    assert _inspected(capsys, tmp_path / "robot.sdf")["details"]["base"] == "fixed to the world"


def test_servo_constants_that_name_only_the_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "servo.yaml"
    path.write_text("model: XL-330\n")
    said = _inspected(capsys, path)
    assert (said["kind"], said["details"]["model"]) == ("servo_constants", "XL-330")
    path.write_text("model: XL-999\n")
    assert "servo.yaml: model: no servo profile for 'XL-999'" in refused(capsys, "inspect", str(path))


def test_model_yaml(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    effect = "{effect: backlash, where: [flm], parameters: {gap: 3.1}}"
    (tmp_path / "model.yaml").write_text(f"format: 1\nrobot: {{}}\neffects: [{effect}]\n")
    said = _inspected(capsys, tmp_path / "model.yaml")
    assert (said["kind"], said["details"]["effects"]) == ("fitted_model", ["backlash flm"])


def test_capture_with_a_gap(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = record_arm(tmp_path)
    lines = path.read_text().splitlines()
    row = lines[50].split(",")
    lines[50] = ",".join([*row[:2], *[""] * 7, *row[9:]])
    path.write_text("\n".join(lines) + "\n")
    said = _inspected(capsys, path)
    assert (said["kind"], said["version"], said["rate"]) == ("motive", "1.23", 120.0)
    assert set(said["assets"]) == {"Trunk", "Upper", "Middle", "Lower"}
    (gap,) = said["gaps"].values()
    assert gap == pytest.approx(1 / said["frames"])
    assert said["share_of_gaps"] == pytest.approx(gap / 4)
    assert any("1 filled" in p for p in said["problems"])


def test_joint_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    time = np.arange(100) / 50
    rows = "".join(f"{t},{10 * np.sin(t)},{9 * np.sin(t)}\n" for t in time)
    (tmp_path / "log.csv").write_text("time,goal.neck,position.neck\n" + rows)
    said = _inspected(capsys, tmp_path / "log.csv")
    assert (said["kind"], said["frames"], said["joints"]) == ("joint_log", 100, ["neck"])
    assert said["rate"] == pytest.approx(50)


def test_rollout_and_firmware_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = write_session(tmp_path)
    motion = str(tmp_path / "motions" / "wave.csv")
    succeeds(capsys, "simulate", motion, "--model", str(session), "--base", "fixed", "--out", str(tmp_path / "run"))
    said = _inspected(capsys, tmp_path / "run" / "rollout.csv")
    assert (said["kind"], said["rate"], said["details"]["base"]) == ("rollout", 1000.0, "fixed")
    succeeds(capsys, "export", motion, "--model", str(session), "--out", str(tmp_path / "tables"))
    said = _inspected(capsys, tmp_path / "tables")
    assert (said["kind"], said["joints"], said["duration"]) == ("firmware_tables", MOTION.split("\n")[0].split(",")[1:], 0.9)


@pytest.mark.parametrize(("name", "kind", "rate", "frames"), [
    ("data/motive/motive_1.21_rigidbody_rbmarker_marker_quat_m.csv", "motive", 120.0, 250),
    ("data/motive/motive_1.23_marker_mm_30Hz.csv", "motive", 30.0, 2032),
    ("data/motive/motive_1.23_header_only_no_assets_mm_360Hz.csv", "motive", 360.0, 1353),
    ("data/xl330/2026-01-15_10h28m10.json", "bam_log", 187.23, 1124),
    ("data/so101/raw/step_response", "sage", 49.85, 6000),
    ("data/mtn/bio_gp_humanoid_kr.mtn", "motion_file", None, None),
])
def test_real_files(name: str, kind: str, rate: float | None, frames: int | None, capsys: pytest.CaptureFixture[str]) -> None:
    said = _inspected(capsys, shared(name))
    assert (said["kind"], said["frames"]) == (kind, frames)
    assert said["rate"] == (None if rate is None else pytest.approx(rate, abs=0.01))


def test_text_says_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    text = succeeds(capsys, "inspect", str(data_file("robotis_walk.csv")))
    assert "kind" in text
    assert "15: blb blm blt" in text
    assert text.rstrip().endswith("no problems")


@pytest.mark.parametrize(("content", "said"), [
    ("nothing of the kind\n", "not a recording"),
    ("", "empty"),
    ("time,neck\n0,0\n1,nan\n", "line 3, column neck: expected a finite number"),
    ("Format Version,1.23,Take Name,cut\n", "line"),
    ("<sdf version='1.7'><model name='x'/>", "not whole XML"),
])
def test_what_it_cannot_read_is_one_line(content: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file.csv").write_text(content)
    assert said in refused(capsys, "inspect", str(tmp_path / "file.csv"))
