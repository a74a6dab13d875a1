"""A motion: poses of joint angles at their arrival times, and the table of it that people write."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.motion.commands import Commands
from workbench.motion.mtn import load_mtn
from workbench.motion.table import PoseTable
from workbench.robot import BUS_IDS, JOINTS, InputError, RobotModel
from workbench.robot.files import read_text, write_whole

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses at their arrival times; the first row is where the cycle closes, and is not sent (contract, section 2).

    times: (K,) [s], increasing, K at least 2. joints: (n,) names. angles: (K, n) [rad], zero = servo centre.
    """

    name: str
    times: Array
    joints: tuple[str, ...]
    angles: Array
    source: str = "motion"

    def __post_init__(self) -> None:
        if self.angles.shape != (len(self.times), len(self.joints)):
            raise InputError(self.source, f"expected angles for {len(self.times)} times and {len(self.joints)} joints")
        if len(self.times) < 2 or not self.joints:
            raise InputError(self.source, "expected one joint or more and two rows: where the cycle closes, and a pose")
        twice = [j for i, j in enumerate(self.joints) if j in self.joints[:i]]
        if twice:
            raise InputError(self.source, f"joint '{twice[0]}' stands there twice")
        for k, i in np.argwhere(~np.isfinite(self.angles))[:1]:
            raise InputError(
                self.source, f"row {k + 1}, joint {self.joints[i]}: expected a finite angle, got {self.angles[k, i]}")
        for k in np.flatnonzero(~np.isfinite(self.times))[:1]:
            raise InputError(self.source, f"row {k + 1}: expected a finite time, got {self.times[k]}")
        for k in np.flatnonzero(np.diff(self.times) <= 0)[:1]:
            before, after = self.times[k:k + 2]
            raise InputError(self.source, f"row {k + 2}: time {after:.10g} s does not come after {before:.10g} s")

    @property
    def duration(self) -> float:
        """Length of one cycle [s]."""
        return float(self.times[-1] - self.times[0])

    @property
    def closes(self) -> bool:
        """Whether the last row is the first one, so that cycles follow each other without a jump."""
        return bool(np.allclose(self.angles[0], self.angles[-1], rtol=0, atol=1e-9))

    def as_table(self) -> PoseTable:
        """In the firmware's units (thesis, equations 3.1 to 3.4); InputError for what the registers cannot hold."""
        return PoseTable.from_angles(self.joints, self.times, self.angles, self.source)

    def commands(self, cycles: int = 1) -> Commands:
        """What the firmware sends for so many cycles, rounded to the servo's counts and milliseconds."""
        return self.as_table().commands(cycles)


def load_motion(path: str | Path, model: RobotModel | None = None) -> Motion:
    """Reads a pose table (CSV, degrees), or a page of a ROBOTIS motion file as `FILE.mtn#page`.

    Columns are found by the header's names; without a header they are `time` and the model's joints in alphabetical
    order (without a model, the puppy's). InputError names line and column of what is wrong, or a joint `model` lacks.
    """
    file, _, page = str(path).partition("#")
    if file.lower().endswith(".mtn"):
        return load_mtn(file).motion(page or None, (model.bus_ids if model else None) or BUS_IDS)
    return _parse(path, read_text(path), model)


def save_motion(motion: Motion, path: str | Path) -> Path:
    """Writes the pose table that `load_motion` reads (degrees, ten digits), whole or not at all."""
    rows = np.column_stack([motion.times, np.degrees(motion.angles)])
    lines = [",".join(["time", *motion.joints])] + [",".join(f"{x + 0.0:.10g}" for x in row) for row in rows]
    return write_whole(path, "\n".join(lines) + "\n")


Line = tuple[int, list[str]]


def _parse(path: str | Path, text: str, model: RobotModel | None) -> Motion:
    lines = [(n, [cell.strip() for cell in line.split(",")]) for n, line in enumerate(text.splitlines(), start=1)
             if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise InputError(path, "empty; expected rows of time and joint angles")
    names, rows = _columns(path, lines, model)
    table = np.empty((len(rows), len(names)))
    for k, (n, cells) in enumerate(rows):
        if len(cells) != len(names):
            raise InputError(path, f"line {n}: expected {len(names)} cells, found {len(cells)}")
        table[k] = [_number(path, n, name, cell) for name, cell in zip(names, cells)]
    at = names.index("time")
    joints = tuple(name for name in names if name != "time")
    return Motion(Path(path).stem, table[:, at], joints, np.radians(np.delete(table, at, axis=1)), str(path))


def _columns(path: str | Path, lines: list[Line], model: RobotModel | None) -> tuple[list[str], list[Line]]:
    """Names of the columns, and the rows under them."""
    n, first = lines[0]
    known: Sequence[str] | None = model.joints if model else None
    if all(_is_number(cell) for cell in first):
        joints = sorted(known or JOINTS)
        if len(first) != len(joints) + 1:
            raise InputError(
                path, f"line {n}: without a header, expected time and {len(joints)} joints, found {len(first)} cells")
        return ["time", *joints], lines
    if "time" not in first:
        raise InputError(path, f"line {n}: expected a header with a column 'time', found {', '.join(first[:4])}")
    for name in first:
        if first.count(name) > 1:
            raise InputError(path, f"line {n}: column '{name}' stands there twice")
        if name != "time" and known is not None and name not in known:
            raise InputError(path, f"line {n}: the robot has no joint '{name}'; its joints: {' '.join(known)}")
    return first, lines[1:]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _number(path: str | Path, line: int, name: str, cell: str) -> float:
    value = float(cell) if _is_number(cell) else math.nan
    if not math.isfinite(value):
        raise InputError(path, f"line {line}, column {name}: expected a finite number, found '{cell}'")
    return value
