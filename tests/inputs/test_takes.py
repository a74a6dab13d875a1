"""Takes that do not show what a session needs of them: no rest, no goals, no readings, the same recording twice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.command import refused, succeeds
from tests.gap_sessions import STARTS_AT, record_arm, session_content, write_session
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes
from workbench.files import InputError

RATE = 120


def _from(path: Path, first: int) -> None:
    """Cuts the frames before `first` away, as a capture that was started too late has none."""
    lines = path.read_text().splitlines(keepends=True)
    top = next(n for n, line in enumerate(lines) if line.startswith("Frame")) + 1
    path.write_text("".join(lines[:top] + lines[top + first:]))


@pytest.mark.parametrize("late", [0.1, 0.25, 0.5])
def test_a_capture_that_begins_in_motion_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], late: float) -> None:
    write_session(tmp_path)
    take = record_arm(tmp_path)
    _from(take, round((STARTS_AT + late) * RATE))
    with pytest.raises(InputError, match="the robot moves when the recording begins"):
        read_takes(load_session(tmp_path))
    capsys.readouterr()
    assert "none of its takes can be used" in refused(capsys, "inspect", str(tmp_path / "session.yaml"))


@pytest.mark.parametrize("rest", [0.0, 0.1, 0.3])
def test_a_capture_that_begins_just_before_the_first_command_is_read(tmp_path: Path, rest: float) -> None:
    write_session(tmp_path)
    _from(record_arm(tmp_path), round((STARTS_AT - rest) * RATE))
    assert len(read_takes(load_session(tmp_path))[0]) == 1


def _log(folder: Path, name: str, joints: str, unread: str = "", seed: int = 0) -> dict[str, str]:
    """A take of the arm's servos: `joints` have goals, all of them but `unread` readings."""
    time = np.arange(0, 4, 0.02)
    rng = np.random.default_rng(seed)
    names, columns = ["time"], [time]
    for k, joint in enumerate(joints.split()):
        goal = 25 * np.sin((2 + 0.3 * k) * time)
        read = np.interp(time - 0.06, time, goal) + rng.normal(0, 0.05, len(time))
        names += [f"goal.{joint}", f"position.{joint}"]
        columns += [goal, np.full(len(time), np.nan) if joint in unread.split() else read]
    rows = [",".join("" if np.isnan(v) else f"{v:.6g}" for v in row) for row in np.column_stack(columns)]
    (folder / f"{name}.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    return {"name": name, "recording": f"{name}.csv", "base": "fixed"}


def _session(folder: Path, *takes: dict[str, str]) -> str:
    content = session_content()
    del content["robot"]["rigid_bodies"]
    write_session(folder, yaml.safe_dump(content | {"takes": list(takes)}))
    return str(folder / "session.yaml")


def test_joints_that_a_log_does_not_have_are_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "no problems" in succeeds(capsys, "inspect", _session(tmp_path, _log(tmp_path, "a", "one two three")))
    assert "the log has no goals of three: simulated as held at zero" in succeeds(
        capsys, "inspect", _session(tmp_path, _log(tmp_path, "a", "one two")))
    assert "the log has no readings of two: " in succeeds(
        capsys, "inspect", _session(tmp_path, _log(tmp_path, "a", "one two three", unread="two")))


def test_a_log_without_any_reading_is_refused(tmp_path: Path) -> None:
    path = _session(tmp_path, _log(tmp_path, "a", "one two three", unread="one two three"))
    with pytest.raises(InputError, match=r"a\.csv: no joint has a position to compare with"):
        read_takes(load_session(path))


def test_a_recording_listed_twice_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, again, other = (_log(tmp_path, name, "one two three", seed=seed) for name, seed in (("a", 0), ("b", 0), ("c", 1)))
    said = succeeds(capsys, "inspect", _session(tmp_path, first, again, other))
    assert "take 'b': has the same recording as take 'a'" in said
    assert said.count("problem:") == 1


def test_a_name_too_long_for_files_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="of at most 100 bytes"):
        load_session(_session(tmp_path, _log(tmp_path, "a", "one two three") | {"name": "x" * 101}))
