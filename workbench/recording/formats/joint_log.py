"""Joint logs (docs/formats.md, section 3): CSV of time, goals and each servo's readings; also as commands of a prediction."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa

from workbench.files import InputError
from workbench.files.reading import write_whole
from workbench.files.tables import is_binary
from workbench.recording.formats.log_commands import commands_of_rows, order_problem
from workbench.recording.formats.numbers import Bytes, column, rate_of, read_columns, strings, table_bytes
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.formats.table_header import table_header
from workbench.recording.recording import Recording
from workbench.types import Array

_DEGREES = np.pi / 180
_SCALE = {"goal": _DEGREES, "speed": _DEGREES, "position": _DEGREES, "velocity": _DEGREES, "duty": 1.0, "current": 1.0,
          "temperature": 1.0, "enabled": 1.0}
_TRUE, _FALSE = {"1", "1.0", "true"}, {"0", "0.0", "false"}


def looks_like_joint_log(head: bytes) -> bool:
    """Whether a file that begins with `head` has a header with `time` and goals or positions of joints."""
    cells = () if is_binary(head) else table_header(head).names
    return "time" in cells and any(c.startswith(("goal.", "position.")) for c in cells)


def read_joint_log(path: str | Path) -> Recording:
    """Reads a joint log; degrees and deg/s become rad and rad/s, blanks NaN. Its commands are its goals.

    InputError where a column is unknown, time does not increase, a joint has no goal, or a cell is no number. Positions given in
    the first row alone are a start, and the file then is the commands of a prediction.
    """
    source = str(path)
    content, written = table_bytes(path)
    header = table_header(content)
    names = list(header.names)
    _check_names(source, names[1:] if header.index else names, header.lines)
    text = {i for i, name in enumerate(names) if name.startswith("enabled.")}
    wanted = set(range(int(header.index), len(names)))
    table = read_columns(source, content, header.end, header.lines, len(names), text, wanted)
    time = column(table, names.index("time"))
    if (problem := order_problem(time)) is not None:
        raise InputError(source, f"line {problem.row + header.lines + 1}: {problem.text}")
    channels = {name: _channel(source, table, i, name, header.lines) for i, name in enumerate(names)
                if name != "time" and i in wanted}
    problems = _cut_number(content, len(time) + header.lines)
    joints = tuple(n.removeprefix("goal.") for n in names if n.startswith("goal."))
    goals = np.column_stack([channels[f"goal.{j}"] for j in joints])
    on = np.ones(len(time))
    enabled = np.column_stack([channels.get(f"enabled.{j}", on) for j in joints]) != 0
    initial = np.array([channels.get(f"position.{j}", [np.nan])[0] for j in joints])
    at_once = np.zeros(len(time))
    speeds = np.column_stack([np.nan_to_num(channels.get(f"speed.{j}", at_once)) for j in joints])
    return Recording(source=source, kind="joint_log", version="", time=time, frames=np.arange(len(time)), rate=rate_of(time),
                     units="degrees", channels=channels, commands=commands_of_rows(time, joints, goals, enabled, initial, speeds),
                     metadata={"written with": written} if written else {}, problems=problems)


def _check_names(source: str, names: list[str], line: int) -> None:
    for i, name in enumerate(names):
        kind, dot, joint = name.partition(".")
        if not name:
            raise InputError(source, f"line {line}: column {i + 1} has no name: a comma at the end of the line? Delete it in "
                                     "each row")
        if name[-2:] in (".1", ".2") and name[:-2] in names:
            raise InputError(source, f"line {line}: column '{name}': '{name[:-2]}' was there twice when pandas read it; keep "
                                     "one")
        if name in names[:i]:
            raise InputError(source, f"line {line}: column '{name}' is given twice")
        if name not in ("time", "voltage") and not (dot and joint and kind in _SCALE):
            raise InputError(source, f"line {line}: unknown column '{name[:40]}'; expected time, voltage, or one of "
                                     f"{', '.join(k + '.JOINT' for k in _SCALE)}")
        if dot and f"goal.{joint}" not in names:
            near = next((n for n in names if n.startswith("goal.") and _plain(n) == _plain(f"goal.{joint}")), None)
            hint = "" if near is None else f"; '{near}' differs in case or blanks: write both alike"
            raise InputError(source, f"line {line}: column '{name}' without 'goal.{joint}'{hint}")
    if "time" not in names or not any(n.startswith("goal.") for n in names):
        raise InputError(source, f"line {line}: expected a column 'time' and goals of joints")


def _plain(name: str) -> str:
    return "".join(name.split()).lower()


def _cut_number(content: Bytes, line: int) -> tuple[str, ...]:
    """A line if the file ends within its last number: no line end, and fewer decimals than in all rows above."""
    tail = bytes(content[-20_000:]).decode("utf-8", "replace").split("\n")
    if len(tail) < 12 or not tail[-1].strip():
        return ()
    decimals = [len(row.rstrip("\r").rpartition(",")[2].partition(".")[2]) for row in tail[1:]]
    if decimals[-1] < min(decimals[:-1]):
        return (f"line {line}: the last number has fewer decimals than those above and no line end follows: the file was cut "
                "there; delete the last row",)
    return ()


def _channel(source: str, table: pa.Table, index: int, name: str, above: int) -> Array:
    kind = name.partition(".")[0]
    if kind != "enabled":
        return column(table, index) * _SCALE.get(kind, 1.0)
    out, last = np.empty(table.num_rows), 1.0
    for n, cell in enumerate(strings(table, index)):
        word = cell.strip().lower()
        if word and word not in _TRUE | _FALSE:
            raise InputError(source, f"line {n + above + 1}, {name}: expected 1 or 0, got '{cell}'")
        last = last if not word else float(word in _TRUE)  # a blank repeats the last one
        out[n] = last
    return out


def write_joint_log(path: str | Path, time: Array, channels: Mapping[str, Array]) -> Path:
    """Writes a joint log whole or not at all; channels in SI and radians, by the names of docs/formats.md; NaN becomes a
    blank."""
    rows = [np.asarray(time, dtype=float), *(np.asarray(c, dtype=float) / _SCALE.get(n.partition(".")[0], 1.0)
                                            for n, c in channels.items())]
    out = io.StringIO()
    write = csv.writer(out, lineterminator="\n").writerow
    write(["time", *channels])
    for row in np.column_stack(rows):
        write(["" if np.isnan(v) else f"{v:.9g}" for v in row])
    return write_whole(path, out.getvalue())


FORMAT = RecordingFormat("joint_log", "a joint log", looks_like_joint_log, read_joint_log)
