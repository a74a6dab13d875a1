"""Reads pose tables: CSV in degrees, or a page of a ROBOTIS motion file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.files.nearest import did_you_mean
from workbench.files.numerals import number_of, whole_of
from workbench.files.reading import write_whole
from workbench.files.tables import plain_text
from workbench.motion.motion import Motion
from workbench.motion.mtn import load_mtn
from workbench.motion.table import MOST_CYCLES, SECTIONS
from workbench.motion.trajectory import is_bag, load_trajectory
from workbench.robot import BUS_IDS, JOINTS, RobotModel, bus_ids
from workbench.robot.servo_units import units_of

MOST_SECONDS, MOST_DEGREES = 3600.0, 3600.0
"""A table of more than an hour, or more than ten turns, is in another unit."""

SPEED = "speed."
"""Prefix of a joint's name in the column of its moving speeds."""
SECTION, CYCLES = "section", "# cycles:"
"""The column for start, loop and stop, and the comment for the number of cycles."""


def load_motion(path: str | Path, model: RobotModel | None = None) -> Motion:
    """Reads a pose table (CSV, degrees), a page of a ROBOTIS motion file as `FILE.mtn#page`, or a joint trajectory in a bag of
    ROS.

    Columns are found by the header's names; without a header they are `time` and the model's joints in alphabetical
    order (without a model, the puppy's). Columns `speed.JOINT` [deg/s], of every joint or of none, are moving speeds that replace
    the travel over the dwell. A column `section` contains `start`, `loop` or `stop`, in that order: start and stop are played
    once, the loop is repeated; without it the whole table is the loop. A comment line `# cycles: N` gives the number of cycles,
    unless the caller does. When it is played, the motion is rounded to the counts of the model's servos (without a model, the
    AX-12A's). InputError names line and column of an error, or a joint that `model` lacks.
    """
    file, _, page = str(path).partition("#")
    if file.lower().endswith(".mtn"):
        motion = load_mtn(file).motion(page or None, bus_ids(model) if model else BUS_IDS,
                                       model.mountings if model else None)
    elif is_bag(file):
        motion = load_trajectory(file, page)
        strange = [joint for joint in motion.joints if model is not None and joint not in model.joints]
        if strange and model is not None:
            raise InputError(path, f"the robot has no joint '{strange[0]}'; its joints: {' '.join(model.joints)}"
                             + did_you_mean(strange[0], model.joints))
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
    rows = [",".join(f"{x + 0.0:.10g}" for x in row) for row in np.hstack(columns)]
    if motion.start or motion.stop:
        header.insert(0, SECTION)
        rows = [f"{section},{row}" for section, row in zip(motion.sections, rows)]
    lines = [f"# {about}"] if about else []
    lines += [f"{CYCLES} {motion.cycles}"] if motion.cycles is not None else []
    return "\n".join([*lines, ",".join(header), *rows]) + "\n"


Line = tuple[int, list[str]]


def _parse(path: str | Path, text: str, model: RobotModel | None) -> Motion:
    lines = [(n, [cell.strip() for cell in line.split(",")]) for n, line in enumerate(text.splitlines(), start=1)
             if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        raise InputError(path, "empty; expected rows of time and joint angles")
    cycles = _cycles(path, text)
    names, rows = _columns(path, lines, model)
    start, stop, names, rows = _sections(path, names, rows)
    table = np.empty((len(rows), len(names)))
    for k, (n, cells) in enumerate(rows):
        if len(cells) != len(names):
            raise InputError(path, f"line {n}: expected {len(names)} cells, found {len(cells)}")
        table[k] = [_number(path, n, name, cell) for name, cell in zip(names, cells)]
    joints = tuple(name for name in names if name != "time" and not name.startswith(SPEED))
    ramped = [name for name in names if name.startswith(SPEED)]
    for name in (*(SPEED + j for j in joints if ramped), *ramped):
        if name not in names or name.removeprefix(SPEED) not in joints:
            raise InputError(path, f"line {lines[0][0]}: column '{name}': expected {SPEED}JOINT for every joint or for none")

    def columns(wanted: Sequence[str]) -> NDArray[np.float64]:
        return np.radians(table[:, [names.index(name) for name in wanted]])

    return Motion(Path(path).stem, table[:, names.index("time")], joints, columns(joints), str(path),
                  columns([SPEED + j for j in joints]) if ramped else None, start=start, stop=stop, cycles=cycles)


def _cycles(path: str | Path, text: str) -> int | None:
    """The number of cycles in the file's comment; None without one."""
    cycles: int | None = None
    for n, line in enumerate(text.splitlines(), start=1):
        if line.startswith(CYCLES):
            value = whole_of(line.removeprefix(CYCLES).strip())
            if value is None or not 1 <= value <= MOST_CYCLES:
                raise InputError(path, f"line {n}: expected '{CYCLES} N' with N from 1 to {MOST_CYCLES}, found '{line[:40]}'")
            if cycles not in (None, value):
                raise InputError(path, f"line {n}: '{line[:40]}' after '{CYCLES} {cycles}'; expected one number of cycles")
            cycles = value
    return cycles


def _sections(path: str | Path, names: list[str], rows: list[Line]) -> tuple[int, int, list[str], list[Line]]:
    """How many poses of start and stop the column `section` says, and names and rows without it."""
    if SECTION not in names:
        return 0, 0, names, rows
    column = names.index(SECTION)
    last, of_rows = 0, list[str]()
    for n, cells in rows:
        found = cells[column] if column < len(cells) else ""
        if found not in SECTIONS:
            raise InputError(path, f"line {n}, column {SECTION}: expected {', '.join(SECTIONS)}, found '{found[:40]}'")
        if SECTIONS.index(found) < last:
            raise InputError(path, f"line {n}, column {SECTION}: '{found}' after '{SECTIONS[last]}'; expected start, loop, stop")
        last = SECTIONS.index(found)
        of_rows.append(found)
    if of_rows and of_rows[0] != of_rows[min(1, len(of_rows) - 1)]:
        problem = f"'{of_rows[0]}' has no pose: the first row only gives the start of the second"
        raise InputError(path, f"line {rows[0][0]}, column {SECTION}: {problem}")
    if "loop" not in of_rows:
        raise InputError(path, f"column {SECTION}: expected rows of a loop")
    start, stop = of_rows[1:].count("start"), of_rows[1:].count("stop")
    return (start, stop, [name for name in names if name != SECTION],
            [(n, cells[:column] + cells[column + 1:]) for n, cells in rows])


def _columns(path: str | Path, lines: list[Line], model: RobotModel | None) -> tuple[list[str], list[Line]]:
    """Names of the columns, and the rows under them."""
    n, first = lines[0]
    known: Sequence[str] | None = model.joints if model else None
    if all(_is_number(cell) for cell in first):
        joints = sorted(known or JOINTS)
        if len(first) != len(joints) + 1:
            raise InputError(
                path, f"line {n}: without a header, expected time and {len(joints)} joints, found {len(first)} cells "
                      "(export a Motive take or a log again with its header)")
        return ["time", *joints], lines
    if "time" not in first:
        raise InputError(path, f"line {n}: expected a header with a column 'time', found {', '.join(first[:4])}")
    for name in first:
        if first.count(name) > 1:
            raise InputError(path, f"line {n}: column '{name}' is given twice")
        if name not in ("time", SECTION) and known is not None and name.removeprefix(SPEED) not in known:
            raise InputError(path, f"line {n}: the robot has no joint '{name}'; its joints: {' '.join(known)}"
                             + did_you_mean(name, known))
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
