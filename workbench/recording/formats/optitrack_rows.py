"""OptiTrack's older export, in rows: comment, info, rigidbody and frame rows (Tracking Tools, Arena); metres, y up."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.files.numerals import number_of
from workbench.files.tables import is_binary, plain_text, split_row
from workbench.recording.formats.capture_table import Capture, recording_of
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording

_WIDTH = 11
"""Cells of a body in a frame's row: its number, x y z, a quaternion x y z w, three angles."""


def matches(head: bytes) -> bool:
    """Recognised by its rows: comments or info first, then `frame` or `rigidbody` rows."""
    if is_binary(head):
        return False
    first = head.lstrip(b"\xef\xbb\xbf").split(b",", 1)[0].strip().lower()
    return first in (b"comment", b"info", b"righthanded", b"lefthanded") and any(
        word in head for word in (b"\nrigidbody,", b"\nframe,", b"\ninfo,"))


def read_optitrack_rows(path: Path) -> Recording:
    """Reads bodies by the names of their `rigidbody` rows; a body missing from a frame is a gap. InputError names the line of a
    truncated row."""
    source = str(path)
    names: dict[int, str] = {}
    times, frames = list[float](), list[dict[int, list[float]]]()
    for n, line in enumerate(plain_text(path).splitlines(), start=1):
        row = split_row(line)
        word = row[0].lower() if row else ""
        if word == "lefthanded":
            raise InputError(source, f"line {n}: OptiTrack's older row format with left-handed axes; export it right-handed")
        if word == "rigidbody" and len(row) > 2 and (number := number_of(row[2])) is not None:
            names[int(number)] = row[1]
        elif word == "frame":
            values = [number_of(c) for c in row[1:]]
            count = values[2] if len(values) > 2 else None
            last = 3 + _WIDTH * int(count or 0)
            if count is None or len(values) < last or None in values[:last]:
                raise InputError(source, f"line {n}: OptiTrack's older row format: expected frame, index, time, how many "
                                         f"bodies, and "
                                         f"{_WIDTH} numbers of each")
            cells = [v or 0.0 for v in values[3:]]
            times.append(float(values[1] or 0.0))
            frames.append({int(cells[i]): cells[i + 1:i + 8] for i in range(0, _WIDTH * int(count), _WIDTH)})
    if not frames or not names:
        raise InputError(source, "OptiTrack's older row format without rigid bodies; define the robot's bodies and export it "
                                 "again")
    bodies = {}
    for number, name in names.items():
        poses = np.array([frame.get(number, [np.nan] * 7) for frame in frames])
        bodies[name] = poses[:, :3], poses[:, [6, 3, 4, 5]]
    return recording_of(source, "optitrack_rows", Capture(np.array(times), bodies, {}, up="y", version="older row format"))


FORMAT = RecordingFormat("optitrack_rows", "OptiTrack's older row format", matches, read_optitrack_rows)
