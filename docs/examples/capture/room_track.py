"""A capture system's text file: a line `bodies NAME NAME …`, then lines `seconds` and for each body `x y z qx qy qz qw`, z up."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.recording import Recording
from workbench.recording.formats.capture_table import Capture, recording_of
from workbench.recording.formats.registry import RecordingFormat

FIRST = b"bodies "
EACH = 7


def matches(head: bytes) -> bool:
    """Recognised by its first line."""
    return head.startswith(FIRST)


def read(path: Path) -> Recording:
    """Metres, quaternions turned to wxyz; InputError names the line that is damaged. `recording_of` turns z up into the axes of
    recordings and checks times, units and the quaternions' order."""
    first, *lines = path.read_text(encoding="utf-8").splitlines()
    names, rows = first.split()[1:], []
    for number, line in enumerate(lines, start=2):
        try:
            row = [float(cell) for cell in line.split()]
        except ValueError:
            raise InputError(path, f"line {number}: expected numbers, got '{line[:40]}'") from None
        if len(row) != 1 + EACH * len(names):
            raise InputError(path, f"line {number}: expected {1 + EACH * len(names)} numbers, got {len(row)}")
        rows.append(row)
    table = np.array(rows, dtype=float).reshape(-1, 1 + EACH * len(names))
    bodies = {}
    for k, name in enumerate(names):
        part = table[:, 1 + EACH * k:1 + EACH * (k + 1)]
        bodies[name] = part[:, :3], part[:, [6, 3, 4, 5]]
    return recording_of(str(path), "room_track", Capture(table[:, 0], bodies, {}))


FORMAT = RecordingFormat("room_track", "a room tracker's text file", matches, read)
