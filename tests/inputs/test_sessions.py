"""`inspect` opens every file of a session and reports the errors of the other verbs; full disks, and files of killed runs."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
import yaml

from tests.command import refused, succeeds
from tests.gap_sessions import record_arm, session_content, write_session
from workbench.cli import progress
from workbench.cli.check import check_session
from workbench.cli.output import LEFT, output_directory
from workbench.compare.session import load_session
from workbench.files import InputError
from workbench.inspect.problems import session_check, summarize
from workbench.recording import read_recording, write_motive


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """A session of an arm whose take is sound."""
    write_session(tmp_path)
    record_arm(tmp_path)
    return tmp_path


def _rewrite(folder: Path, **changes: object) -> Path:
    content = session_content() | changes
    (folder / "session.yaml").write_text(yaml.safe_dump(content))
    return folder / "session.yaml"


def test_a_sound_session_has_no_problems(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no problems" in succeeds(capsys, "inspect", str(arm / "session.yaml"))
    assert "no problems" in succeeds(capsys, "inspect", str(arm))  # as compare and diagnose take its folder


def _unseen(row: str) -> str:
    return ",".join(row.split(",")[:2]) + "," * (row.count(",") - 1)


@pytest.mark.parametrize(("keep", "said"), [
    (lambda rows: rows[:8], "holds 1 frame"), (lambda rows: [*rows[:7], *map(_unseen, rows[7:])], "no rigid body was seen"),
])
def test_a_take_that_shows_nothing_is_refused_at_once(arm: Path, capsys: pytest.CaptureFixture[str], keep, said: str) -> None:
    path = arm / "takes" / "wave.csv"
    path.write_text("\n".join(keep(path.read_text().splitlines())) + "\n")
    assert said in succeeds(capsys, "inspect", str(arm), code=2)
    assert said in refused(capsys, "compare", str(arm), "--out", str(arm / "out"), "--jobs", "1")


@pytest.mark.parametrize(("damage", "said"), [
    (lambda p: p.write_text("root:x:0:0\n"), "not a recording"),
    (lambda p: p.write_text(""), "empty"), (lambda p: p.write_text(p.read_text().replace("Upper", "Wing")), "asset 'Wing'"),
])
def test_a_recording_that_cannot_be_used_is_told(arm: Path, capsys: pytest.CaptureFixture[str], damage, said: str) -> None:
    damage(arm / "takes" / "wave.csv")
    assert said in succeeds(capsys, "inspect", str(arm / "session.yaml"), code=2)


def test_a_recording_cut_short_is_told(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = arm / "takes" / "wave.csv"
    path.write_bytes(path.read_bytes()[:-3000])
    assert "take 'wave'" in succeeds(capsys, "inspect", str(arm / "session.yaml"))


def test_servos_of_some_joints_are_told(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content = session_content()
    content["robot"]["servos"] = {"one": "servo.yaml"}
    _rewrite(arm, robot=content["robot"])
    assert "none is given for three, two" in succeeds(capsys, "inspect", str(arm / "session.yaml"))


@pytest.mark.parametrize(("key", "value"), [("cycles", 10**9), ("cycles", 10**18 - 1), ("starts_at", 1e9)])
def test_numbers_beyond_reason_are_refused(arm: Path, capsys: pytest.CaptureFixture[str], key: str, value: float) -> None:
    takes = session_content()["takes"]
    takes[0][key] = value
    assert f"takes[0].{key}: expected" in refused(capsys, "inspect", str(_rewrite(arm, takes=takes)))


def test_the_yaw_is_a_key_and_is_named_where_it_is_missed(arm: Path) -> None:
    path = arm / "takes" / "wave.csv"
    seen = read_recording(path)
    still = {a: type(b)(np.repeat(b.p[:1], len(b.p), axis=0), np.repeat(b.quat[:1], len(b.p), axis=0))
             for a, b in seen.rigid_bodies.items()}
    write_motive(path, still, seen.rate)
    from workbench.compare.session_takes import capture_yaw, read_takes

    session = load_session(arm / "session.yaml")
    with pytest.raises(InputError, match=r"takes wave: yaw: no tracked joint turns .*give the session's `yaw`"):
        capture_yaw(session, read_takes(session)[0])
    assert session_check(session).refused is not None
    with pytest.raises(InputError, match="takes wave: yaw"):  # before anything is simulated
        check_session("compare", session)
    session = load_session(_rewrite(arm, yaw=30.0))
    assert capture_yaw(session, read_takes(session)[0]) == pytest.approx(np.deg2rad(30))


def test_a_frozen_body_is_a_warning_of_every_verb(arm: Path) -> None:
    path = arm / "takes" / "wave.csv"
    rows = [line.split(",") for line in path.read_text().splitlines()]
    rng = np.random.default_rng(0)
    for k, row in enumerate(rows[7:]):
        for column in range(2, len(row)):
            if row[column] and k % 200 < 150:
                row[column] = f"{float(row[column]) + rng.normal(0, 1e-4):.6f}"
            elif k % 200 >= 150 and k > 0:
                row[column] = rows[7 + k - 1][column]
    path.write_text("\n".join(",".join(row) for row in rows) + "\n")
    found = session_check(load_session(arm / "session.yaml"))
    assert any("repeat the pose before" in line for line in found.warnings)
    assert len(found.warnings) == 1


def test_a_motion_of_a_take_is_checked_as_alone(arm: Path, capsys: pytest.CaptureFixture[str]) -> None:
    motion = arm / "motions" / "wave.csv"
    head, *rows = motion.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    small = [",".join([time, *(f"{float(angle) / 57.3:.4f}" for angle in angles)]) for time, *angles in cells]
    motion.write_text("\n".join([head, *small]) + "\n")
    said = succeeds(capsys, "inspect", str(arm))
    assert f"take 'wave': {motion}: no joint leaves" in said
    assert "radians" in said


def test_many_problems_are_one_line() -> None:
    assert summarize(["a", "b", "c", "d"]) == "a; b; c (and 1 more: see workbench inspect)"


def test_warnings_wait_for_a_run_that_ends_well_or_is_long(capsys: pytest.CaptureFixture[str]) -> None:
    progress.warn("compare", ["something"])
    assert capsys.readouterr().err == ""
    progress.show_warnings()
    assert capsys.readouterr().err == "workbench compare: warning: something\n"
    progress.warn("compare", ["another"])
    progress.forget_warnings()
    progress.show_warnings()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("name", ["findings.json", "comparison.json"])
def test_what_the_workbench_wrote_is_known(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    import json

    content = {"findings.json": {"format": 1, "verdict": "no_gap", "findings": []},
               "comparison.json": {"format": 1, "takes": [{"name": "walk"}], "joints_by_error": []}}[name]
    (tmp_path / name).write_text(json.dumps(content))
    for what in (tmp_path / name, tmp_path):
        assert name.removesuffix(".json") in succeeds(capsys, "inspect", str(what))
    (tmp_path / "report.html").write_text("<!doctype html><html><title>A report</title></html>")
    assert "A report" in succeeds(capsys, "inspect", str(tmp_path / "report.html"))


def test_an_empty_folder_says_what_was_expected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(capsys, "inspect", str(tmp_path))
    assert "session.yaml" in line
    assert "pos.txt" in line


def test_what_killed_runs_left_is_cleared_and_what_runs_stays(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    dead, alive = tmp_path / f"{LEFT}{ended.pid}-x", tmp_path / f"{LEFT}{os.getppid()}-y"
    for folder in (dead, alive):
        folder.mkdir()
        (folder / "half.csv").write_text("1")
    with output_directory(tmp_path / "out"):
        assert not dead.exists()
        assert alive.exists()


def test_a_full_disk_is_said_before_the_work(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"out: cannot be written \(.* MB are free"), output_directory(tmp_path / "out", 10**18):
        raise AssertionError("the work began")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("named", [True, False])
def test_a_disk_that_fills_is_told_with_the_users_path(tmp_path: Path, named: bool) -> None:
    def fill(folder: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), *([str(folder / "replay.html")] if named else []))

    with pytest.raises(InputError, match=r"out: cannot be written \(No space left on device\)"), \
            output_directory(tmp_path / "out") as folder:
        fill(folder)
    assert list(tmp_path.iterdir()) == []


def test_a_memory_that_fills_the_disk_is_cleared(arm: Path) -> None:
    from workbench.cli.memory import rollout_memory

    def fill(folder: Path) -> None:
        (folder / "a.npy").write_text("1")
        raise OSError("51948 requested and 51168 written")  # as numpy says it

    session = load_session(arm / "session.yaml")
    with pytest.raises(InputError, match="the disk is full"), rollout_memory(arm / "out", session) as folder:
        fill(folder)
    assert not list(arm.glob(".out.resume-*"))


def test_progress_says_which_stage_and_does_not_fall_silent(capsys: pytest.CaptureFixture[str]) -> None:
    import time

    with patch("workbench.cli.progress.BEAT", 0.05), progress.Progress("compare", quiet=0, stages=("reading", "drawing")) as tell:
        time.sleep(0.05)
        tell("reading a", 0.1)
        time.sleep(0.4)
        tell("drawing b")
        tell("reading again")
    lines = capsys.readouterr().err.splitlines()
    assert sum("1 of 2, reading a 10 %" in line for line in lines) >= 2
    assert any("2 of 2, drawing b" in line for line in lines)
    assert any("2 of 2, reading again" in line for line in lines)
