"""The range of each joint, as limited by brackets and links."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

from workbench.files import InputError
from workbench.files.reading import read_text
from workbench.files.resources import data_file
from workbench.robot.model import PUPPY, RobotModel

TABLE = "joint_ranges.csv"
COLUMNS = ["joint", "lower", "upper", "source"]


@dataclass(frozen=True)
class JointRange:
    """lower, upper [rad]; source: where the numbers come from."""

    lower: float
    upper: float
    source: str


def joint_ranges(model: RobotModel) -> dict[str, JointRange]:
    """Range of each joint: the narrower of the model file's limits and of the table joint_ranges.csv, which for the puppy ships
    with the workbench and for another robot lies beside its model file, if there is one. InputError names line and joint of the
    table."""
    table = data_file(TABLE) if model.description == PUPPY else model.path.parent / TABLE
    known = _read(table, model) if model.description == PUPPY or table.is_file() else {}
    out = {}
    for joint in model.joints:
        frame = model.kinematics.frames[joint]
        own = JointRange(frame.lower, frame.upper, f"limits in {model.path.name}")
        given = known.get(joint)
        out[joint] = own if given is None else JointRange(max(own.lower, given.lower), min(own.upper, given.upper), given.source)
    return out


def _read(path: Path, model: RobotModel) -> dict[str, JointRange]:
    lines = [(n, line) for n, line in enumerate(read_text(path).splitlines(), start=1) if line.strip() and line[0] != "#"]
    if not lines or lines[0][1].split(",") != COLUMNS:
        raise InputError(path, f"expected the columns {', '.join(COLUMNS)}")
    out: dict[str, JointRange] = {}
    for n, line in lines[1:]:
        cells = next(csv.reader([line]))
        if len(cells) != len(COLUMNS):
            raise InputError(path, f"line {n}: expected {len(COLUMNS)} cells, found {len(cells)}")
        joint, lower, upper, source = cells
        if joint not in model.joints or joint in out:
            raise InputError(path, f"line {n}: expected each of the robot's joints once, found '{joint}'")
        try:
            low, high = math.radians(float(lower)), math.radians(float(upper))
        except ValueError:
            raise InputError(path, f"line {n}, joint {joint}: expected two angles in degrees") from None
        if not low < high:
            raise InputError(path, f"line {n}, joint {joint}: expected lower below upper")
        out[joint] = JointRange(low, high, source)
    return out
