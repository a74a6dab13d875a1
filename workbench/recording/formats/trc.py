"""TRC tables of markers (Motion Analysis, OpenSim); y up. Rigid bodies are formed of markers with a common name."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.files.numerals import number_of
from workbench.files.tables import is_binary, plain_text, split_row
from workbench.recording.formats.capture_table import METRES, Capture, recording_of
from workbench.recording.formats.numbers import rate_of
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording
from workbench.types import Array

_FIRST = b"PathFileType"
_DISAGREE = 0.02
"""Allowed difference of the header's rate from that of the times, which are rounded, as a share."""


def matches(head: bytes) -> bool:
    """Recognised by its first word."""
    return not is_binary(head) and head.lstrip(b"\xef\xbb\xbf").startswith(_FIRST)


def read_trc(path: Path) -> Recording:
    """Reads markers by their names; a blank is a gap. InputError where header or rows are not those of a TRC."""
    source = str(path)
    lines = [split_row(line) for line in plain_text(path).replace("\t", ",").splitlines()]
    if len(lines) < 6:
        raise InputError(source, f"a TRC table of markers that is cut: {len(lines)} lines; expected five of header, and rows")
    about = dict(zip(lines[1], lines[2]))
    unit = about.get("Units", "")
    if unit.lower() not in METRES:
        raise InputError(source, f"line 3: TRC: Units '{unit[:20]}'; expected m, cm or mm")
    names = [name for name in lines[3][2:] if name]
    at, problems = _places(source, names, lines[4][2:])
    rows = [(n, row) for n, row in enumerate(lines[5:], start=6) if any(row)]
    table = np.full((len(rows), 3 * len(names)), np.nan)
    time = np.empty(len(rows))
    for k, (n, row) in enumerate(rows):
        if any(row[2 + table.shape[1]:]):
            raise InputError(source, f"line {n}: TRC: {len(row) - 2} numbers of {len(names)} markers; expected {table.shape[1]}")
        value = number_of(row[1]) if len(row) > 1 else None
        if value is None:
            raise InputError(source, f"line {n}: TRC: expected a frame's number, its time and its markers")
        time[k] = value
        for i, cell in enumerate(row[2:2 + table.shape[1]]):
            if cell:
                found = number_of(cell)
                if found is None:
                    raise InputError(source, f"line {n}, column {i + 3}: TRC: expected a number, got '{cell[:40]}'")
                table[k, i] = found * METRES[unit.lower()]
    markers: dict[str, np.ndarray] = {}
    for i, name in enumerate(names):
        if name in markers:
            problems = (*problems, f"two markers are called '{name}': the first is read")
        markers.setdefault(name, table[:, at[i]])
    return recording_of(source, "trc", Capture(time, {}, markers, up="y", units=unit, problems=(*problems, *_rate(about, time))))


def _rate(about: Mapping[str, str], time: Array) -> list[str]:
    """A line if the header's rate is not that of the times (N,) [s]."""
    said, measured = number_of(about.get("DataRate", "")), rate_of(time)
    if said is None or not np.isfinite(measured) or abs(said / measured - 1) < _DISAGREE:
        return []
    return [f"the header says {said:g} frames a second, the times {measured:.4g}; the times are used"]


def _places(source: str, names: list[str], axes: list[str]) -> tuple[list[list[int]], tuple[str, ...]]:
    """Columns of each marker's x, y and z by the line that names them X1, Y1, Z1 and so on, in that order where it does not
    say; and a line if it has another order. InputError where it is not of these markers."""
    usual = [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(len(names))]
    axes = [axis.upper() for axis in axes]
    wanted = [[f"{letter}{i + 1}" for letter in "XYZ"] for i in range(len(names))]
    flat = [axis for marker in wanted for axis in marker]
    if all(axis in ("", own) for axis, own in zip(axes, flat)) and not any(axes[len(flat):]):
        return usual, ()
    given = [axis for axis in axes if axis]
    places = {axis: i for i, axis in enumerate(axes)}
    if sorted(given) != sorted(flat):
        odd = next((a for a in given if a not in flat or given.count(a) > 1), "")
        raise InputError(source, f"line 5: TRC: expected X, Y and Z of {len(names)} markers, X1 to Z{len(names)}, "
                                 + (f"found '{odd[:20]}'" if odd else f"found {len(given)} of {len(flat)}"))
    at = [[places[axis] for axis in marker] for marker in wanted]
    moved = at != usual
    return at, ("the header has the axes of its markers in another order than X, Y, Z: another program changed this file; each "
                "column is read by its name: check that its values moved along",) if moved else ()


FORMAT = RecordingFormat("trc", "a TRC table of markers", matches, read_trc)
