"""CSV exports of Vicon (Nexus, Tracker): segments or objects with rotation and translation, and trajectories of markers; z up."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.files.numerals import number_of
from workbench.files.tables import is_binary, plain_text, split_row
from workbench.recording import quaternions as quat
from workbench.recording.formats.capture_table import METRES, Capture, recording_of
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording
from workbench.types import Array

_KINDS = ("objects", "segments", "trajectories")


def matches(head: bytes) -> bool:
    """Whether it begins with the name of one of Vicon's tables alone in a line, and has their columns."""
    if is_binary(head):
        return False
    first = head.lstrip(b"\xef\xbb\xbf").split(b"\n", 1)[0].strip().strip(b",").lower().decode("ascii", "replace")
    return first in _KINDS and b"Sub Frame" in head


def read_vicon(path: Path) -> Recording:
    """Reads the first table of a Vicon export. A rotation of three numbers is a rotation vector, of four (RW) a quaternion;
    blanks are gaps. InputError names the line of a value that is not a number."""
    source = str(path)
    lines = [split_row(line) for line in plain_text(path).splitlines()]
    head = next((i for i, row in enumerate(lines) if row[:2] == ["Frame", "Sub Frame"]), None)
    rate = number_of(lines[1][0]) if len(lines) > 1 and lines[1] else None
    if head is None or head < 2 or rate is None or rate <= 0:
        raise InputError(source, "Vicon's table: expected its kind, its rate, the names and a row that begins Frame, Sub Frame")
    names, axes, units = lines[head - 1], lines[head], lines[head + 1] if head + 1 < len(lines) else []
    rows = []
    for n, row in enumerate(lines[head + 2:], start=head + 3):
        if not any(row):
            break
        rows.append([_cell(source, n, i, c) for i, c in enumerate(row)] + [np.nan] * (len(axes) - len(row)))
    table = np.array([row[:len(axes)] for row in rows]).reshape(len(rows), len(axes))
    starts = [i for i in range(2, len(axes)) if i < len(names) and names[i]]
    bodies: dict[str, tuple[Array, Array]] = {}
    markers: dict[str, Array] = {}
    for first, end in zip(starts, [*starts[1:], len(axes)]):
        of = {axes[i].upper().rstrip("'"): i for i in range(first, end)}
        name = names[first].rpartition(":")[2].strip() or names[first]
        scale = METRES.get((units[of.get("TX", of.get("X", first))] if len(units) > first else "mm").lower(), 1e-3)
        if {"TX", "TY", "TZ", "RX", "RY", "RZ"} <= set(of):
            bodies[name] = table[:, [of["TX"], of["TY"], of["TZ"]]] * scale, _turn(table, of, units)
        elif {"X", "Y", "Z"} <= set(of):
            markers[name] = table[:, [of["X"], of["Y"], of["Z"]]] * scale
    return recording_of(source, "vicon", Capture(np.arange(len(table)) / rate, bodies, markers, units="mm"))


def _cell(source: str, line: int, column: int, cell: str) -> float:
    value = number_of(cell) if cell else float("nan")
    if value is None:
        raise InputError(source, f"line {line}, column {column + 1}: Vicon's table: expected a number, got '{cell[:40]}'")
    return value


def _turn(table: Array, of: dict[str, int], units: list[str]) -> Array:
    """Quaternions (N, 4) wxyz of a body's columns."""
    v = table[:, [of["RX"], of["RY"], of["RZ"]]]
    if "RW" in of:
        return np.column_stack([table[:, of["RW"]], v])
    if of["RX"] < len(units) and units[of["RX"]].lower().startswith("deg"):
        v = np.deg2rad(v)
    angle = np.linalg.norm(v, axis=1, keepdims=True)
    q = np.concatenate([np.cos(angle / 2), v * np.sinc(angle / (2 * np.pi)) / 2], axis=1)
    good = np.isfinite(q).all(axis=1)
    if good.any():
        q[good] = quat.continuous(q[good])[0]
    return q


FORMAT = RecordingFormat("vicon", "a CSV of Vicon", matches, read_vicon)
