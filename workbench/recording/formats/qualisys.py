"""6D tables of Qualisys Track Manager (TSV): positions [mm] and rotation matrices of rigid bodies, z up."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.files.numerals import number_of
from workbench.files.tables import is_binary, plain_text
from workbench.recording.formats.capture_table import Capture, recording_of, rotations
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording

_FIRST = b"NO_OF_FRAMES"
_WIDTH = 16
"""Columns of a body: X Y Z, three angles, a residual, nine of the rotation matrix, column by column."""


def matches(head: bytes) -> bool:
    """Recognised by its first word."""
    return not is_binary(head) and head.lstrip(b"\xef\xbb\xbf").startswith(_FIRST)


def read_qualisys(path: Path) -> Recording:
    """Reads a 6D export; a body that was not seen (zeros) is a gap. InputError where the file holds markers alone, or a row is
    not as wide as the header says."""
    source = str(path)
    lines = [re.split(r"[\t,]", line.rstrip()) for line in plain_text(path).splitlines()]
    header = {row[0]: row[1:] for row in lines[:20] if row[0].isupper()}
    if "6D" not in (header.get("DATA_INCLUDED") or [""])[0] or "BODY_NAMES" not in header:
        raise InputError(source, "a table of Qualisys without 6D data (markers alone); export the rigid bodies: File, Export, "
                                 "TSV, "
                                 "6D")
    names = [n.strip() for n in header["BODY_NAMES"] if n.strip()]
    rate = number_of((header.get("FREQUENCY") or [""])[0])
    if not names or rate is None or rate <= 0:
        raise InputError(source, "Qualisys' 6D table: expected BODY_NAMES and FREQUENCY in its header")
    first = next((i for i, row in enumerate(lines) if row[0] == "Frame"), None)
    frame = first is not None
    if first is None:
        first = next((i for i, row in enumerate(lines) if row[0] == "BODY_NAMES"), 0) + 1
    rows = [(i + 1, row) for i, row in enumerate(lines) if i > first and any(row)]
    skip = 2 if frame else 0
    data = np.empty((len(rows), _WIDTH * len(names)))
    for k, (n, row) in enumerate(rows):
        cells = [number_of(c) for c in row[skip:skip + data.shape[1]]]
        if len(cells) < data.shape[1] or any(c is None for c in cells):
            raise InputError(source, f"line {n}: Qualisys' 6D table: expected {data.shape[1]} numbers ({_WIDTH} of each body: "
                                     f"X Y Z, "
                                     f"angles, residual, Rot[0] to Rot[8]), found {sum(c is not None for c in cells)}")
        data[k] = [c if c is not None else np.nan for c in cells]
    bodies = {}
    for i, name in enumerate(names):
        of = data[:, _WIDTH * i:_WIDTH * (i + 1)]
        q = rotations(source, name, of[:, 7:16].reshape(-1, 3, 3).transpose(0, 2, 1), rows[0][0] if rows else 1)
        bodies[name] = np.where(np.isfinite(q[:, :1]), of[:, :3] * 1e-3, np.nan), q
    return recording_of(source, "qualisys", Capture(np.arange(len(rows)) / rate, bodies, {}, units="mm"))


FORMAT = RecordingFormat("qualisys", "a 6D table of Qualisys", matches, read_qualisys)
