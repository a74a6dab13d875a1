"""What a file of robot motion holds, told by its content."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Literal

from workbench.recording.formats.rollout_table import is_rollout
from workbench.robot import InputError

Kind = Literal["recording", "motion", "rollout"]


def file_kind(path: str | Path) -> Kind:
    """A rollout by its first line, a motion by its columns (or a ROBOTIS file), else a recording. InputError where there is no
    such file."""
    path = Path(str(path).partition("#")[0])
    if path.suffix.lower() == ".mtn":
        return "motion"
    if path.is_dir():
        return "recording"  # a SAGE programme is a folder
    try:
        with path.open("rb") as f:
            lines = [line.decode("utf-8-sig", errors="replace").strip() for line in f.read(100_000).splitlines()]
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None
    if lines and is_rollout(lines[0]):
        return "rollout"
    first = next((line for line in lines if line and not line.startswith("#")), "")
    cells = [c.strip() for c in next(csv.reader([first]), [])]
    plain = "time" in cells and not any("." in c for c in cells)
    return "motion" if plain or _numbers(cells) else "recording"


def _numbers(cells: list[str]) -> bool:
    try:
        return bool([float(c) for c in cells])
    except ValueError:
        return False
