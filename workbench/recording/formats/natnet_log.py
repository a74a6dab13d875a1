"""Pose logs written by NatNet clients: poses without bodies' names, header or frame numbers; recognised in order to be
refused."""

from __future__ import annotations

import re
from pathlib import Path

from workbench.files import InputError
from workbench.files.tables import is_binary, split_row
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording

_TURN = r"(rot(ation)?|quat(ernion)?|q|r|o(rientation)?)(_rs)?"
_POSE = (r"(.*[ ./_])?((pos(ition)?|t|p|trans(lation)?)(_rs_r)?)?[ _./]?x", rf"(.*[ ./_])?{_TURN}[ _./]?x",
         rf"(.*[ ./_])?{_TURN}[ _./]?w")
"""Columns of a position and a quaternion as NatNet, ROS, TUM and EuRoC name them, with any prefix (a topic, a body)."""


def _cells(head: bytes) -> list[str]:
    line = next((line for line in head.split(b"\n") if line.strip()), b"")
    text = line.decode("utf-8-sig", "replace").lstrip("# ")
    cells = split_row(text) if "," in text else text.split()
    return [re.sub(r"\s*\[[^\]]*\]", "", cell) for cell in cells]  # [ns], [m]


def matches(head: bytes) -> bool:
    """Whether the first line names columns of a position and a quaternion, and nothing that Motive's own export has."""
    if is_binary(head):
        return False
    if head.lstrip(b'\xef\xbb\xbf" ').startswith(b"Format Version"):
        return False
    cells = [c.lower() for c in _cells(head)]
    return len(cells) > 6 and all(any(re.fullmatch(p, c) for c in cells) for p in _POSE)


def read(path: Path) -> Recording:
    """Raises InputError with the apparent content and the missing data: the file does not name the robot's body, or has no
    times."""
    from workbench.files.tables import plain_head

    cells = _cells(plain_head(path))
    timed = any(re.fullmatch(r"(?i)(%?time.*|t|stamp|frame.*|secs?)", c) for c in cells)
    lacks = "no body's name" if timed else "neither times nor a body's name"
    raise InputError(path, f"line 1: looks like a NatNet client's pose log ({', '.join(cells[:8])}), with {lacks}; expected "
                           "Motive's own export (File, Export Tracking Data, CSV, with header, quaternions, Global) of all the "
                           "robot's rigid bodies in one file")


FORMAT = RecordingFormat("natnet_log", "", matches, read, priority=1)
