"""Tables that ROS tools make of a joint trajectory controller's state: `rostopic echo -p`, PlotJuggler, `ros2 topic` exports.

Columns end in the field's name, a joint's name or index: `.../reference/positions[0]` (or desired, or setpoint, or command) and
`.../feedback/positions[0]` (or actual, or position); with `joint_names` beside, these name the joints. Radians.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.files.tables import is_binary, split_row
from workbench.recording.formats.log_commands import commands_of_rows, out_of_order
from workbench.recording.formats.numbers import column, rate_of, read_columns, strings, table_bytes
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording
from workbench.types import Array

_TIME = re.compile(r"%time|__time|timestamp|time|(.*[./])?header[./]stamp", re.IGNORECASE)
_SECONDS = re.compile(r"(?:.*[./])?(?:stamp|time)[./]secs?", re.IGNORECASE)
_NANO = re.compile(r"(?:.*[./])?(?:stamp|time)[./](?:nano_?sec|nsec)s?", re.IGNORECASE)
_EPOCHS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))
"""Units of times since 1970, which are 1.7e18 ns, 1.7e15 us, 1.7e12 ms or 1.7e9 s: the least number for each unit, and the
unit in seconds."""
_GOAL = r"(reference|desired|setpoint|goal|command)"
_SEEN = r"(feedback|actual|measured|state|output)"
_INDEXED = r"[./]positions?[._]?\[?(\d+)\]?"
_FIELDS = {"goal": re.compile(rf"(?:.*[./])?{_GOAL}{_INDEXED}", re.IGNORECASE),
           "position": re.compile(rf"(?:.*[./])?{_SEEN}{_INDEXED}", re.IGNORECASE)}
_NAMED = {"goal": re.compile(rf"(?:.*[./])?([^./]+)[./]{_GOAL}(?:[./]position)?", re.IGNORECASE),
          "position": re.compile(r"(?:.*[./])?([^./]+)[./](?:position|state[./]position)", re.IGNORECASE)}
_JOINT = re.compile(r"(?:.*[./])?joint_?names?[._]?\[?(\d+)\]?", re.IGNORECASE)


def _columns(cells: list[str]) -> tuple[int | None, dict[str, dict[str, int]], dict[str, int]]:
    """Column of the time; of goals and positions by joint or index; of joints' names by index."""
    time = next((i for i, c in enumerate(cells) if _TIME.fullmatch(c)), None)
    if time is None:
        time = next((i for i, c in enumerate(cells) if _SECONDS.fullmatch(c)), None)
    found: dict[str, dict[str, int]] = {"goal": {}, "position": {}}
    names: dict[str, int] = {}
    for i, cell in enumerate(cells):
        if (m := _JOINT.fullmatch(cell)) is not None:
            names[m.group(1)] = i
            continue
        for kind in found:
            m = _FIELDS[kind].fullmatch(cell)
            if m is not None:
                found[kind].setdefault(m.group(2), i)
                break
            m = _NAMED[kind].fullmatch(cell)
            if m is not None:
                found[kind].setdefault(m.group(1), i)
                break
    return time, found, names


def matches(head: bytes) -> bool:
    """Whether the header has a time, and goals and positions of the same joints, by ROS's names with slashes or brackets."""
    if is_binary(head):
        return False
    line = head.partition(b"\n")[0].decode("utf-8-sig", "replace")
    if not any(mark in line for mark in ("/", "[", "field.", "positions")):
        return False
    time, found, _ = _columns(split_row(line))
    return time is not None and bool(set(found["goal"]) & set(found["position"]))


def read_ros_csv(path: Path) -> Recording:
    """Reads goals and positions [rad] of the joints that have both; nanoseconds become seconds. Rows in which only another topic
    has a value are skipped. InputError if a cell is not a number or time does not increase."""
    source = str(path)
    content, _ = table_bytes(path)
    end = content.find(b"\n")
    cells = split_row(content[:end if end >= 0 else len(content)].decode("utf-8-sig", "replace"))
    time_at, found, names = _columns(cells)
    keys = [k for k in found["goal"] if k in found["position"]]
    if time_at is None or not keys:
        raise InputError(source, "line 1: expected a time, and goals and positions of the same joints")
    nano_at = next((i for i, c in enumerate(cells) if _NANO.fullmatch(c)), None) if _SECONDS.fullmatch(cells[time_at]) else None
    wanted = {time_at, *([] if nano_at is None else [nano_at]), *(found[kind][k] for kind in found for k in keys)}
    table = read_columns(source, content, end + 1 if end >= 0 else len(content), 1, len(cells), set(names.values()),
                         wanted | set(names.values()))
    goals, positions = (np.column_stack([column(table, found[kind][k]) for k in keys]) for kind in ("goal", "position"))
    time = column(table, time_at)
    if nano_at is not None:
        time = time - time[0] + 1e-9 * column(table, nano_at)
    whole = np.isfinite(time) & np.isfinite(goals).all(axis=1) & np.isfinite(positions).all(axis=1)
    time, goals, positions = time[whole], goals[whole], positions[whole]
    scale = next((of for least, of in _EPOCHS if len(time) and time[0] > least), 1.0)
    if len(time) < 2 or out_of_order(time).any() or out_of_order((time - time[0]) * scale).any():
        raise InputError(source, f"column '{cells[time_at]}': expected increasing times in two rows or more")
    time = (time - time[0]) * scale
    joints = tuple(_name(table, names, k) for k in keys)
    if len(set(joints)) < len(joints):
        raise InputError(source, f"two columns of names say '{max(joints, key=joints.count)}'; expected each joint once")
    if all(k in names for k in keys):
        told = np.array([strings(table, names[k]) for k in keys], dtype=str).T[whole]
        goals, positions = _by_name(source, joints, told, goals, positions)
    channels = {f"goal.{j}": goals[:, i] for i, j in enumerate(joints)}
    channels |= {f"position.{j}": positions[:, i] for i, j in enumerate(joints)}
    return Recording(source=source, kind="ros_csv", version="", time=time, frames=np.arange(len(time)), rate=rate_of(time),
                     units="radians", channels=channels,
                     commands=commands_of_rows(time, joints, goals, np.ones(goals.shape, dtype=bool)))


def _by_name(source: str, joints: tuple[str, ...], told: NDArray[np.str_], goals: Array, positions: Array) -> tuple[Array, Array]:
    """Goals and positions (N, n) in the order of `joints`; `told` (N, n): the names in each row's own order, blank where that is
    the usual one."""
    for row in np.flatnonzero((told != np.array(joints)).any(axis=1) & (told != "").all(axis=1)):
        said = [name.strip() for name in told[row]]
        if sorted(said) != sorted(joints):
            raise InputError(source, f"row {row + 1} names {', '.join(said[:6])}; expected {', '.join(joints[:6])} as in the "
                                     "first")
        order = [said.index(j) for j in joints]
        goals[row], positions[row] = goals[row, order], positions[row, order]
    return goals, positions


def _name(table: pa.Table, names: dict[str, int], key: str) -> str:
    """A joint's name: the key itself or, if it is an index, the entry in the column of names, or joint_1 and so on."""
    if not key.isdecimal():
        return key
    if key in names:
        name = next((s for s in strings(table, names[key]) if s), "")
        if name:
            return name.strip()
    return f"joint_{int(key) + 1}"


FORMAT = RecordingFormat("ros_csv", "a table of a ROS controller's state", matches, read_ros_csv)
