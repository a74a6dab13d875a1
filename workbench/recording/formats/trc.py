"""TRC tables of markers (Motion Analysis, OpenSim); y up. Rigid bodies are formed of markers with a common name."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.files.numerals import number_of
from workbench.files.tables import is_binary, plain_text, split_row
from workbench.recording.formats.capture_table import METRES, Capture, recording_of
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording

_FIRST = b"PathFileType"


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
    rows = [(n, row) for n, row in enumerate(lines[5:], start=6) if any(row)]
    table = np.full((len(rows), 3 * len(names)), np.nan)
    time = np.empty(len(rows))
    for k, (n, row) in enumerate(rows):
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
    markers = {name: table[:, 3 * i:3 * i + 3] for i, name in enumerate(names)}
    return recording_of(source, "trc", Capture(time, {}, markers, up="y", units=unit))


FORMAT = RecordingFormat("trc", "a TRC table of markers", matches, read_trc)
