"""Poses of rigid bodies as one plain table, for any capture system: time, BODY.x, BODY.y, BODY.z, BODY.qw, BODY.qx, BODY.qy,
BODY.qz of each body. Seconds, metres (or BODY.x_mm), unit quaternions; z is up."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.files.tables import is_binary
from workbench.recording.formats.capture_table import Capture, recording_of
from workbench.recording.formats.numbers import column, read_columns, table_bytes
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.formats.table_header import table_header
from workbench.recording.recording import Recording

PLACE, TURN = ("x", "y", "z"), ("qw", "qx", "qy", "qz")
_MM = "_mm"
_MOST = 5
"""Of a body's seven columns."""


def _bodies(names: tuple[str, ...]) -> dict[str, dict[str, int]]:
    """Columns of each body by quantity."""
    out: dict[str, dict[str, int]] = {}
    for i, name in enumerate(names):
        body, dot, what = name.rpartition(".")
        if dot and body and what.removesuffix(_MM) in (*PLACE, *TURN):
            out.setdefault(body, {})[what.removesuffix(_MM)] = i
    return out


def matches(head: bytes) -> bool:
    """Whether the header has most columns of at least one body's position and quaternion by these names, so that the missing one
    can be named."""
    return not is_binary(head) and any(len(of) >= _MOST for of in _bodies(table_header(head).names).values())


def read_body_poses(path: Path) -> Recording:
    """Reads such a table; a blank cell is a gap. InputError if a body lacks a column, a column is unknown, or a cell is not a
    number."""
    source = str(path)
    content, _ = table_bytes(path)
    header = table_header(content)
    bodies = _bodies(header.names)
    if "time" not in header.names:
        raise InputError(source, f"line {header.lines}: expected a column 'time' [s], found {', '.join(header.names[:4])} …")
    for n, name in enumerate(header.names):
        if name in header.names[:n]:
            raise InputError(source, f"line {header.lines}: column '{name[:40]}' is given twice")
    for body, of in bodies.items():
        units = {header.names[i].endswith(_MM) for what, i in of.items() if what in PLACE}
        if len(units) > 1 or (f"{body}.x" in header.names and f"{body}.x{_MM}" in header.names):
            raise InputError(source, f"line {header.lines}: places of '{body}' in metres and in millimetres; expected one unit")
        lacking = [w for w in (*PLACE, *TURN) if w not in of]
        if lacking:
            raise InputError(source, f"line {header.lines}: body '{body}' has no column '{body}.{lacking[0]}'")
    known = {i for of in bodies.values() for i in of.values()} | {header.names.index("time")}
    unknown = [n for i, n in enumerate(header.names) if i not in known and not (i == 0 and header.index)]
    if unknown:
        raise InputError(source, f"line {header.lines}: unknown column '{unknown[0][:40]}'; expected time and BODY.x, y, z, "
                                 "qw, qx, qy, qz of each body")
    table = read_columns(source, content, header.end, header.lines, len(header.names), wanted=known)

    def stack(of: dict[str, int], what: tuple[str, ...]) -> np.ndarray:
        scale = [1e-3 if header.names[of[w]].endswith(_MM) else 1.0 for w in what]
        return np.column_stack([column(table, of[w]) * s for w, s in zip(what, scale)])

    poses = {body: (stack(of, PLACE), stack(of, TURN)) for body, of in bodies.items()}
    return recording_of(source, "body_poses", Capture(column(table, header.names.index("time")), poses, {}))


FORMAT = RecordingFormat("body_poses", "a table of body poses", matches, read_body_poses)
