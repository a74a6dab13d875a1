"""The kind of a file of robot motion, recognised by its content."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from workbench.files.numerals import number_of
from workbench.files.tables import is_binary, plain_head, split_row
from workbench.recording.formats.foreign import joint_columns
from workbench.recording.formats.registry import format_of
from workbench.recording.formats.rollout_table import is_rollout

Kind = Literal["recording", "motion", "rollout"]


def file_kind(path: str | Path) -> Kind:
    """A recording of a known format, a rollout by its first line, a motion by its columns (or a ROBOTIS file), else a recording.
    InputError where there is no such file."""
    path = Path(path) if Path(path).exists() else Path(str(path).partition("#")[0])
    if path.suffix.lower() == ".mtn":
        return "motion"
    if path.is_dir():
        return "recording"  # a SAGE programme is a folder
    head = plain_head(path)
    if is_binary(head):
        return "recording"
    if format_of(head) is not None:
        return "recording"
    lines = [line.decode("utf-8-sig", errors="replace").strip() for line in head.splitlines()]
    if lines and is_rollout(lines[0]):
        return "rollout"
    first = next((line for line in lines if line and not line.startswith("#")), "")
    cells = split_row(first)
    plain = "time" in cells and not any(mark in c.removeprefix("speed.") for c in cells for mark in "./[")
    numbers = bool(cells) and all(number_of(c) is not None for c in cells)
    if plain and joint_columns(cells):
        return "recording"
    return "motion" if plain or numbers else "recording"
