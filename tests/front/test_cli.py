"""Common to all verbs: verbosity, the log in the output folder, a user's defaults, completion; and the new verbs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command import refused
from workbench.cli.main import main
from workbench.robot import data_file


@pytest.fixture
def defaults(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "defaults.yaml"
    monkeypatch.setenv("WORKBENCH_DEFAULTS", str(path))
    return path


def test_a_users_defaults_are_taken_and_what_is_typed_wins(defaults: Path, capsys: pytest.CaptureFixture[str]) -> None:
    defaults.write_text("inspect: {json: true}\nall: {quiet: true}\n")
    assert main(["inspect", str(data_file("fox/trot.csv"))]) == 0
    assert json.loads(capsys.readouterr().out)["kind"]


@pytest.mark.parametrize(("text", "problem"), [
    ("dance: {jobs: 2}", "unknown verb 'dance'"), ("diagnose: {legs: 2}", "diagnose: no option --legs"),
    ("all: {legs: 2}", "all: no verb"),
    ("diagnose: {jobs: 0}", "diagnose: jobs: expected a whole number from 1 to"),
    ("simulate: {contact: wet}", "simulate: contact: expected one of"),
    ("diagnose: 3", "expected verbs, each with its options"), ("inspect: {json: 1}", "inspect: json: expected true or false")])
def test_bad_defaults_are_one_line(defaults: Path, text: str, problem: str, capsys: pytest.CaptureFixture[str]) -> None:
    defaults.write_text(text)
    assert main(["inspect", "x"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert str(defaults) in err
    assert problem in err


def test_a_run_leaves_its_log_beside_its_results(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    motion, out = tmp_path / "m.csv", tmp_path / "out"
    motion.write_text("time," + ",".join(f"{leg}_{j}" for leg in ("LF", "LH", "RF", "RH") for j in ("HAA", "HFE", "KFE")) + "\n"
                      + "".join(f"{t}" + ",0" * 12 + "\n" for t in (0, 0.2, 0.4)))
    command = ["simulate", str(motion), "--model", "fox", "--base", "fixed", "--time-step", "0.004", "--verbose",
               "--out", str(out)]
    assert main(command) == 0
    assert "simulating" in capsys.readouterr().err
    log = (out / "workbench.log").read_text()
    assert f"workbench {' '.join(command)}" in log
    assert "s  simulating" in log
    assert log.rstrip().endswith("exit code 0")


def test_nothing_is_written_for_a_run_that_was_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "none.csv: cannot be read" in refused(capsys, "simulate", str(tmp_path / "none.csv"), "--out", str(tmp_path / "out"))
    assert list(tmp_path.iterdir()) == []


def test_the_shell_completes_verbs_and_options(tmp_path: Path) -> None:
    def completed(line: str) -> set[str]:
        words = tmp_path / "words"
        environment = os.environ | {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\013", "COMP_LINE": line,
                                    "COMP_POINT": str(len(line)),
                                    "_ARGCOMPLETE_STDOUT_FILENAME": str(words)}
        subprocess.run([sys.executable, "-m", "workbench"], env=environment, check=True, capture_output=True)
        return {word.strip() for word in words.read_text().split("\013")}

    assert completed("workbench di") == {"diagnose"}
    assert "--thorough" in completed("workbench diagnose --th")


@pytest.mark.parametrize("command", [
    ["simulate", "M"], ["inverse-dynamics", "M"], ["compare", "M", "M"], ["optimize"], ["export", "M"],
    ["flash", "M", "--dry-run"],
    ["servos", "--port", "virtual"], ["play", "M", "--port", "virtual"], ["run", "M"], ["view", "M"]], ids=lambda c: c[0])
def test_every_verb_that_takes_packages_uses_them(command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    robot = tmp_path / "robot.urdf"
    mesh = '<visual><geometry><mesh filename="package://kit/a.stl"/></geometry></visual>'
    robot.write_text(f'<robot name="r"><link name="trunk">{mesh}</link></robot>')
    monkeypatch.chdir(tmp_path)
    trot = str(data_file("fox/trot.csv"))
    said = refused(capsys, *[trot if c == "M" else c for c in command], "--model", str(robot), "--package", f"kit={tmp_path}",
                   *(["--out", "out"] if command[0] != "view" else []))
    assert f"in {tmp_path}" in said  # looked for where the option says, and not there


def test_view_says_where_to_look_and_ends(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", "fox", "--seconds", "0.1", "--take", "walk"]) == 0
    said = capsys.readouterr()
    assert said.out.startswith("open http://localhost:")
    assert "warning: --take has no effect on a model" in said.err


def test_view_plays_a_motion_of_another_robot_than_the_puppy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trot = str(data_file("fox/trot.csv"))
    assert main(["view", trot, "--model", "fox", "--cycles", "1", "--base", "fixed", "--seconds", "0.1"]) == 0
    assert "trot.csv: " in refused(capsys, "view", trot)  # not of the puppy's joints
    assert str(tmp_path) in refused(capsys, "view", str(tmp_path))


def test_doctor_finds_this_machine_well(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["works"]
    names = {check["name"] for check in said["checks"]}
    assert {"Python", "drake", "numpy", "cores", "memory", "Meshcat", "compiled rollouts"} <= names
    assert all(check["remedy"] for check in said["checks"] if check["state"] != "ok")


def test_doctor_says_what_is_broken_and_how(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    import workbench.api.doctor as doctor

    def gone(name: str) -> str:
        raise doctor.PackageNotFoundError(name)

    monkeypatch.setattr(doctor, "version", gone)
    assert main(["doctor"]) == 2
    out = capsys.readouterr().out
    assert " broken  drake" in out
    assert "-> pip install drake" in out
