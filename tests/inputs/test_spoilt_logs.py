"""Servo logs with a spoilt column, a foreign take, or a table written another way: reported with the likely cause."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.command import main
from workbench.files import InputError
from workbench.recording import read_recording
from workbench.recording.formats.file_kind import file_kind

COUNT = 360 / 4096
RATE = 100
Columns = dict[str, np.ndarray]


def _columns() -> Columns:
    """Two joints that follow sines 80 ms late, in counts of a 4096th of a turn."""
    time = np.arange(6 * RATE) / RATE
    out: Columns = {"time": time}
    for joint, phase in (("hip", 0.0), ("knee", 1.4)):
        out[f"goal.{joint}"] = 25 * np.sin(3.1 * time + phase) + 10 * np.sin(7.3 * time + 1 + 2 * phase)
        out[f"position.{joint}"] = np.round(np.interp(time - 0.08, time, out[f"goal.{joint}"]) / COUNT) * COUNT
    return out


def _text(columns: Columns) -> str:
    rows = np.column_stack(list(columns.values()))
    return "\n".join([",".join(columns), *(",".join("" if np.isnan(v) else f"{v:.7g}" for v in row) for row in rows)]) + "\n"


def _problems(folder: Path, content: str | bytes) -> tuple[str, ...]:
    path = folder / "log.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_recording(path).problems


def _change(name: str, new: Callable[[Columns], np.ndarray]) -> Callable[[Columns], Columns]:
    return lambda columns: columns | {name: new(columns)}


def _only(values: np.ndarray, there: np.ndarray) -> np.ndarray:
    return np.where(there, values, np.nan)


def _noise(columns: Columns) -> np.ndarray:
    return columns["position.hip"] + np.random.default_rng(1).normal(0, 3, len(columns["time"]))


def test_a_sound_log_is_not_doubted(tmp_path: Path) -> None:
    assert _problems(tmp_path, _text(_columns())) == ()


@pytest.mark.parametrize(("change", "said"), [
    (_change("position.hip", lambda c: np.abs(c["position.hip"])), "it looks like the goal's absolute value"),
    (_change("position.hip", lambda c: np.gradient(c["goal.hip"], c["time"])), "a velocity or the control error"),
    (_change("position.hip", lambda c: c["goal.hip"] - c["position.hip"]), "a velocity or the control error"),
    (_change("position.hip", lambda c: 20 * np.sin(2.2 * c["time"] ** 1.3)), "is it the recording of another take"),
    (_change("position.hip", lambda c: 2 * c["position.hip"]), "position.hip: goes 2.0"),
    (_change("position.hip", lambda c: c["position.hip"] + 2.5 * c["time"]), "position.hip: drifts by +1"),
    (_change("position.hip", _noise), "position.hip: scatters by"),
    (_change("position.hip", lambda c: np.round(c["position.hip"])), "position.hip: changes in steps of 1 deg"),
    (_change("enabled.hip", lambda c: 0 * c["time"]), "enabled.hip: is 0 in every row while position.hip follows goal.hip"),
    (_change("speed.hip", lambda c: 0 * c["time"] + 1), "speed.hip: is at most 1 deg/s, but position.hip moves at"),
    (_change("current.hip", lambda c: 0 * c["time"] + 350), "current.hip: reaches 350; expected amperes"),
    (_change("temperature.hip", lambda c: 0 * c["time"] + 310), "is it in kelvin"),
    (_change("duty.hip", lambda c: (c["position.hip"] - c["goal.hip"]) / 50), "duty.hip: is opposite to the way"),
    (_change("position.hip", lambda c: _only(c["position.hip"], np.arange(len(c["time"])) % 50 == 7)),
     "position.hip: holds a reading in "),
    (_change("goal.hip", lambda c: _only(c["goal.hip"], c["time"] < 0)), "goal.hip: blank in every row while the joint"),
    (_change("goal.hip", lambda c: _only(c["goal.hip"], c["time"] >= 2)), "goal.hip: blank until 2.000 s while the joint"),
    (_change("time", lambda c: 100 * c["time"]), "is it the number of the row, or of the frame?"),
    (_change("time", lambda c: c["time"] / 3600), "are the times in hours?"),
    (lambda c: {name: values[:12] for name, values in c.items()}, "time: only 12 row(s)"),
    (lambda c: c | {f"position.{j}": c[f"position.{j}"][::-1] for j in ("hip", "knee")}, "does not follow goal"),
])
def test_a_spoilt_column_is_reported_with_its_cause(tmp_path: Path, change: Callable[[Columns], Columns], said: str) -> None:
    assert any(said in text for text in _problems(tmp_path, _text(change(_columns()))))


def test_goals_and_positions_in_each_others_columns(tmp_path: Path) -> None:
    columns = _columns()
    steps = np.random.default_rng(2).uniform(-25, 25, 20)[(columns["time"] / 0.5).astype(int)]
    answer = np.convolve(np.concatenate([np.full(19, steps[0]), steps]), np.ones(20) / 20, "valid")
    columns |= {"goal.hip": np.round(answer / COUNT) * COUNT, "position.hip": steps}
    path = tmp_path / "log.csv"
    path.write_text(_text(columns))
    log = read_recording(path)
    assert any("goal.hip: follows position.hip" in text and "exchanged" in text for text in log.problems)
    assert np.isnan(log.channels["position.hip"]).all()
    assert np.isfinite(log.channels["position.knee"]).any()


@pytest.mark.parametrize(("goals", "said"), [
    (lambda goal, _: np.append(goal[:1], np.diff(goal)), "looks like the change of the position"),
    (lambda goal, position: goal - position, "looks like the way from the position to the goal"),
])
def test_relative_goals_of_steps(tmp_path: Path, goals: Callable[[np.ndarray, np.ndarray], np.ndarray], said: str) -> None:
    time = np.arange(8 * RATE) / RATE
    steps = np.random.default_rng(3).uniform(-25, 25, 20)[(time / 0.5).astype(int)]
    steps[:50] = 0
    position = np.round(np.convolve(np.concatenate([np.zeros(14), steps]), np.ones(15) / 15, "valid") / COUNT) * COUNT
    sound = {"time": time, "goal.hip": steps, "position.hip": position}
    assert not any("relative" in text for text in _problems(tmp_path, _text(sound)))
    assert any(said in text for text in _problems(tmp_path, _text(sound | {"goal.hip": goals(steps, position)})))


def test_a_pause_is_no_jump_of_the_zero(tmp_path: Path) -> None:
    columns = _columns()
    kept = np.r_[0:250, 330:600]
    told = _problems(tmp_path, _text({name: values[kept] for name, values in columns.items()}))
    assert len(told) == 1
    assert "1 pause(s) without rows" in told[0]


@pytest.mark.parametrize(("times", "said"), [
    (lambda t: np.mod(t + 62, 65.536), "a counter of 16 bits that starts again: add 65.536"),
    (lambda t: np.mod(1e6 * t + 2**32 - 2e6, 2**32), "a counter of 32 bits that starts again: add 4294967296"),
    (lambda t: t[::-1], "all rows are in reverse order"),
    (lambda t: np.mod(t, 3), "two logs in one file"),
    (lambda t: np.round(t, 1), "digits were lost"),
    (lambda t: np.where(np.arange(len(t)) == 200, t - 0.01, t), "1 row(s) occur twice"),
    (lambda t: np.where(np.arange(len(t)) == 200, t - 0.025, t), "go back: sort the rows"),
])
def test_times_that_do_not_increase_are_refused_with_the_remedy(tmp_path: Path, times: Callable[[np.ndarray], np.ndarray],
                                                                 said: str) -> None:
    columns = _columns()
    with pytest.raises(InputError) as refused:
        _problems(tmp_path, _text(columns | {"time": times(columns["time"])}))
    assert said in str(refused.value)


def _cells(old: str, new: str) -> Callable[[list[str]], str]:
    return lambda lines: "\n".join([lines[0], *(line.replace(old, new) for line in lines[1:])])


@pytest.mark.parametrize(("write", "said"), [
    (lambda ls: "\n".join(ls).replace(",", "|"), "'|' between the columns: write commas"),
    (lambda ls: "\n".join(ls).replace(",", "  "), "blanks between the columns: write commas"),
    (lambda ls: "\n".join(["Log of 3 May", *ls]), "line 2 is the header: delete the 1 line(s) above it"),
    (lambda ls: "\n".join(["sep=;", *ls]).replace(",", ";"), "line 2 is the header"),
    (_cells(".", ","), "decimal commas between commas?"),
    (lambda ls: "\n".join([ls[0], "s" + ",deg" * 4, *ls[1:]]), "a row of units"),
    (lambda ls: "\n".join([*ls, ls[0]]), "a second header"),
    (lambda ls: "\n".join([*ls, "# end of log"]), "text among the rows"),
    (lambda ls: "\n".join(f"{line}," for line in ls), "a comma at the end of the line"),
    (lambda ls: "\n".join([ls[0], *(f"{line}," for line in ls[1:])]), "a comma at the end of the row"),
    (_cells("-", "\u2212"), "write -"),
    (_cells("0,", "0\u00b0,"), "write the number alone"),
    (lambda ls: "\n".join(ls).encode("utf-16-le"), "UTF-16 without its byte order mark"),
    (lambda ls: "\n".join(ls).encode("utf-32-le"), "UTF-32"),
    (lambda ls: "\n".join(ls).encode() + bytes(400), "not written to the end"),
    (lambda ls: "\n".join([ls[0] + ",position.hip.1", *(line + ",0" for line in ls[1:])]), "when pandas read it"),
    (lambda ls: "\n".join(",".join(row) for row in zip(*(line.split(",") for line in ls))), "transpose it"),
])
def test_a_table_written_another_way_is_refused_with_the_remedy(tmp_path: Path, write: Callable[[list[str]], str | bytes],
                                                                 said: str) -> None:
    with pytest.raises(InputError) as refused:
        _problems(tmp_path, write(_text(_columns()).strip().split("\n")))
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(("name", "content", "said"), [
    ("log.csv", "time,variable,value\n0,goal.hip,1\n0,position.hip,1\n", "one number in each row"),
    ("log.json", '[{"time": 0, "goal.hip": 1}]', "a list of records: write CSV"),
    ("log.jsonl.json", '{"time": 0}\n{"time": 1}\n', "JSON lines"),
    ("log.csv", "<!DOCTYPE html><title>Not found</title>", "on GitHub take the raw file"),
])
def test_other_ways_to_keep_a_log_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, content: str,
                                            said: str) -> None:
    (tmp_path / name).write_text(content)
    main(["inspect", str(tmp_path / name)])
    out = capsys.readouterr()
    assert said in out.out + out.err


def test_a_number_sign_in_a_name_and_a_second_sheet(tmp_path: Path) -> None:
    path = tmp_path / "log #3.csv"
    path.write_text(_text(_columns()))
    assert file_kind(path) == "recording"
    assert read_recording(path).problems == ()
    book = tmp_path / "log.xlsx"
    with pd.ExcelWriter(book) as sheets:
        pd.DataFrame({"note": ["a log"]}).to_excel(sheets, sheet_name="notes", index=False)
        pd.DataFrame(_columns()).to_excel(sheets, sheet_name="log", index=False)
    assert read_recording(book).joints == ("hip", "knee")


@pytest.mark.parametrize("word", ["NA", "null", "None", "#N/A"])
def test_words_for_a_missing_value_are_gaps(tmp_path: Path, word: str) -> None:
    lines = _text(_columns()).strip().split("\n")
    lines[200] = lines[200].rpartition(",")[0] + f",{word}"
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    log = read_recording(path)
    assert log.problems == ()
    assert np.flatnonzero(np.isnan(log.channels["position.knee"])).tolist() == [199]


def test_a_number_that_is_cut_short_is_reported(tmp_path: Path) -> None:
    columns = _columns()
    rows = np.column_stack(list(columns.values()))
    text = "\n".join([",".join(columns), *(",".join(f"{v:.4f}" for v in row) for row in rows)]) + "\n"
    assert any("the file was cut there" in problem for problem in _problems(tmp_path, text[:-3]))
    assert _problems(tmp_path, text[:-1]) == ()
