"""Pose tables as people write them: CSV in degrees, or a page of a ROBOTIS motion file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.files.numerals import number_of
from workbench.files.reading import write_whole
from workbench.files.tables import plain_text
from workbench.motion.motion import Motion
from workbench.motion.mtn import load_mtn
from workbench.robot import BUS_IDS, JOINTS, RobotModel, bus_ids
from workbench.robot.servo_units import units_of

MOST_SECONDS, MOST_DEGREES = 3600.0, 3600.0
"""Beyond an hour, or ten turns, a table is in another unit."""

SPEED = "speed."
"""What a joint's name has before it in the column of its moving speeds."""


def load_motion(path: str | Path, model: RobotModel | None = None) -> Motion:
    """Reads a pose table (CSV, degrees), or a page of a ROBOTIS motion file as `FILE.mtn#page`.

    Columns are found by the header's names; without a header they are `time` and the model's joints in alphabetical
    order (without a model, the puppy's). Columns `speed.JOINT` [deg/s], of all joints or of none, are moving speeds in place of
    the travel over the dwell. What the motion is rounded to when it is played are the counts of the model's servos (without a
    model, the AX-12A's). InputError names line and column of what is wrong, or a joint `model` lacks.
    """
    file, _, page = str(path).partition("#")
    if file.lower().endswith(".mtn"):
        motion = load_mtn(file).motion(page or None, bus_ids(model) if model else BUS_IDS)
    else:
        motion = _parse(path, plain_text(path), model)
    return motion if model is None else replace(motion, units=units_of(model, motion.joints))


def save_motion(motion: Motion, path: str | Path) -> Path:
    """Writes the pose table that `load_motion` reads (degrees, ten digits), whole or not at all."""
    return write_whole(path, motion_text(motion))


def motion_text(motion: Motion, about: str = "") -> str:
    """The text that `save_motion` writes, under a comment line that says `about`, if anything."""
    header, columns = ["time", *motion.joints], [motion.times[:, None], np.degrees(motion.angles)]
    if motion.speeds is not None:
        header += [SPEED + j for j in motion.joints]
        columns.append(np.degrees(motion.speeds))
    lines = [f"# {about}"] if about else []
    lines += [",".join(header)] + [",".join(f"{x + 0.0:.10g}" for x in row) for row in np.hstack(columns)]
    return "\n".join(lines) + "\n"


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
    joints = tuple(name for name in names if name != "time" and not name.startswith(SPEED))
    ramped = [name for name in names if name.startswith(SPEED)]
    for name in (*(SPEED + j for j in joints if ramped), *ramped):
        if name not in names or name.removeprefix(SPEED) not in joints:
            raise InputError(path, f"line {lines[0][0]}: column '{name}': expected {SPEED}JOINT of all joints or of none")

    def columns(wanted: Sequence[str]) -> NDArray[np.float64]:
        return np.radians(table[:, [names.index(name) for name in wanted]])

    return Motion(Path(path).stem, table[:, names.index("time")], joints, columns(joints), str(path),
                  columns([SPEED + j for j in joints]) if ramped else None)


def _columns(path: str | Path, lines: list[Line], model: RobotModel | None) -> tuple[list[str], list[Line]]:
    """Names of the columns, and the rows under them."""
    n, first = lines[0]
    known: Sequence[str] | None = model.joints if model else None
    if all(_is_number(cell) for cell in first):
        joints = sorted(known or JOINTS)
        if len(first) != len(joints) + 1:
            raise InputError(
                path, f"line {n}: without a header, expected time and {len(joints)} joints, found {len(first)} cells "
                      "(of a Motive export or a log without its header, export it anew with it)")
        return ["time", *joints], lines
    if "time" not in first:
        raise InputError(path, f"line {n}: expected a header with a column 'time', found {', '.join(first[:4])}")
    for name in first:
        if first.count(name) > 1:
            raise InputError(path, f"line {n}: column '{name}' stands there twice")
        if name != "time" and known is not None and name.removeprefix(SPEED) not in known:
            raise InputError(path, f"line {n}: the robot has no joint '{name}'; its joints: {' '.join(known)}")
    return first, lines[1:]


def _is_number(cell: str) -> bool:
    return number_of(cell) is not None


def _number(path: str | Path, line: int, name: str, cell: str) -> float:
    value = number_of(cell)
    most, unit = (MOST_SECONDS, "s") if name == "time" else (MOST_DEGREES, "deg")
    if value is None:
        raise InputError(path, f"line {line}, column {name}: expected a finite number, found '{cell[:40]}'")
    if abs(value) > most:
        raise InputError(path, f"line {line}, column {name}: expected at most {most:g} {unit}, found '{cell[:40]}'")
    return value
