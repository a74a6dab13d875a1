"""Servo logs of a rude kind: clocks that start again, absurd rates, names that differ in a blank, columns without a reading."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from tests.inputs.corpus import joint_log, swing
from workbench.files import InputError
from workbench.recording import Recording, read_recording


def _read(folder: Path, text: str) -> Recording:
    (folder / "log.csv").write_text(text)
    return read_recording(folder / "log.csv")


@pytest.mark.parametrize(("period", "unit", "said"), [
    (86400.0, 1.0, "a day, at midnight: add 86400 s"), (86400.0, 1e3, "a day, at midnight: add 86400000 ms"),
    (43200.0, 1.0, "half a day: add 43200 s"), (3600.0, 1.0, "an hour: add 3600 s")])
def test_a_clock_that_starts_again_is_named(tmp_path: Path, period: float, unit: float, said: str) -> None:
    seconds, goal, position = swing(150)
    with pytest.raises(InputError, match=f"a clock that starts again after {said} to the times from there on"):
        _read(tmp_path, joint_log((unit * (seconds + period - 1.0)) % (unit * period), goal, position))


def test_two_logs_in_one_file_are_no_midnight(tmp_path: Path) -> None:
    seconds, goal, position = swing(150)
    text = joint_log(seconds, goal, position)
    with pytest.raises(InputError, match="two logs in one file"):
        _read(tmp_path, text + text.partition("\n")[2])


@pytest.mark.parametrize("factor", [1e-3, 1e-6, 1e-9])
def test_an_absurd_rate_is_told_at_once(tmp_path: Path, factor: float) -> None:
    seconds, goal, position = swing(150)
    rows = (f"{t:.12f},{g:.6g},{p:.6g}" for t, g, p in zip(factor * seconds, goal, position))
    text = "\n".join(["time,goal.arm,position.arm", *rows])
    began = time.monotonic()
    assert any("faster than servos are read" in p for p in _read(tmp_path, text + "\n").problems)
    assert time.monotonic() - began < 5


@pytest.mark.parametrize(("old", "new", "near"), [
    ("goal.arm", "goal.Arm", "goal.Arm"), ("goal.arm", "goal. arm", "goal. arm"), ("position.arm", "position.left arm", None)])
def test_names_that_differ_in_case_or_blanks_are_named(tmp_path: Path, old: str, new: str, near: str | None) -> None:
    text = joint_log(*swing(60)).replace(old, new)
    with pytest.raises(InputError, match=r"without 'goal\.") as caught:
        _read(tmp_path, text)
    assert (f"'{near}' differs in case or blanks: write both alike" in str(caught.value)) is (near is not None)


def test_a_position_without_a_reading_is_told(tmp_path: Path) -> None:
    seconds, goal, _ = swing(60)
    rows = [f"{t:.4g},{g:.6g},nan" for t, g in zip(seconds, goal)]
    problems = _read(tmp_path, "\n".join(["time,goal.arm,position.arm", *rows]) + "\n").problems
    assert "position.arm: holds no reading in any row" in problems
