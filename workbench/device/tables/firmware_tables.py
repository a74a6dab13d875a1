"""Firmware tables: the motion for the controller's program, as the thesis's text files and as a C header."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.device.tables.limits import Violation, refuse_broken_limits
from workbench.device.tables.mounted import in_joint_counts, in_servo_counts, zeros
from workbench.device.tables.table_file import TableFile, encode_table, table_file, unplayable
from workbench.files import InputError
from workbench.files.numerals import whole_of
from workbench.files.reading import read_text, write_together
from workbench.motion import Motion, PoseTable
from workbench.recording.take import Take
from workbench.robot import BUS_IDS, RobotModel, bus_ids
from workbench.robot.mounting import Mounting
from workbench.robot.servo_profile_file import servo_profile
from workbench.robot.servo_units import AX12A, ServoUnits, known_units

Counts = NDArray[np.int64]

GOALS, SPEEDS, DWELLS, HEADER, BINARY = "pos.txt", "speed.txt", "timeDiff.txt", "motion.h", "motion.table"
ORDER, FAMILIES, SECTIONS, MOUNTED = "# joints:", "# servos:", "# sections:", "# mounted:"
_MOST = 2**31 - 1  # of a dwell [ms]; the other registers are checked by the table


@dataclass(frozen=True)
class Export:
    """Files written by `export`, its warnings, and why motion.table is not among the files ("" where it is)."""

    files: tuple[Path, ...]
    violations: tuple[Violation, ...]
    no_binary: str = ""


def export(
    motion: Motion, model: RobotModel, out_dir: str | Path, simulated: Take | None = None, force: bool = False,
) -> Export:
    """Checks a motion against the servos' limits and writes its firmware tables.

    simulated: the motion as it ran in simulation; without it torque goes unchecked. InputError, and nothing written,
    where a limit is broken, unless `force`; warnings never stop it. Values that the registers cannot hold are always refused.
    motion.table is for the CM-530's program, and left out where that cannot play it (other servos, or too many poses).
    """
    check_servos(motion, model)
    table = motion.as_table()
    violations = refuse_broken_limits(table, model, force, simulated, "not exported")
    other, file = unplayable(table), None
    if not other:
        file = table_file(table, model)
        other = unplayable(file.table)
    files = write_tables(table, out_dir, bus_ids(model), None if other else file, model.mountings)
    return Export(tuple(files), tuple(violations), other)


def check_servos(motion: Motion, model: RobotModel) -> None:
    """Before anything is simulated: InputError where a joint's servo has no profile, so that its counts are unknown, or no bus ID
    of its own."""
    known_units(model, motion.joints)
    _check_ids(motion.joints, bus_ids(model), motion.source)


def _check_ids(joints: Sequence[str], ids: Mapping[str, int], source: str) -> None:
    for joint in joints:
        if joint not in ids:
            raise InputError(source, f"joint {joint} has no bus ID; those that have: {' '.join(ids)}")
    shared = [j for j in joints if [ids[k] for k in joints].count(ids[j]) > 1]
    if shared:
        raise InputError(source, f"joints {' and '.join(shared)} share bus ID {ids[shared[0]]}")


def write_tables(
    table: PoseTable, folder: str | Path, ids: Mapping[str, int] = BUS_IDS,
    file: TableFile | None = None, mountings: Mapping[str, Mounting] | None = None,
) -> list[Path]:
    """Writes pos.txt, speed.txt, timeDiff.txt, motion.h and, where `file` holds it with its bounds, motion.table; all or none.

    The text files keep the thesis's layout (figure 3.4: first the number of poses, then a row for each) under a first line with
    the order of joints, the same in all files; where servos are not of the AX-12A's family, a second line names the families,
    whose counts are used; where there are poses of a start or a stop, a line gives their number (SECTIONS), and where a servo
    turns against its joint or has its zero elsewhere, a line lists it (MOUNTED). Goals are those of the servos. InputError for a
    joint without a bus ID.
    """
    _check_ids(table.joints, ids, table.source)
    mounted = [(j, m.direction, zero) for j, u, zero in zip(table.joints, table.units, zeros(table, mountings or {}))
               if (m := (mountings or {}).get(j, Mounting())).direction != 1 or zero != u.centre]
    table = in_servo_counts(table, mountings or {})
    order = f"{ORDER} {' '.join(table.joints)}"
    if any(u != AX12A for u in table.units):
        order += f"\n{FAMILIES} {', '.join(u.family for u in table.units)}"
    if table.start or table.stop:
        order += f"\n{SECTIONS} start {table.start} loop {table.loop} stop {table.stop}"
    if mounted:
        order += f"\n{MOUNTED} {', '.join(f'{joint} {sign:+d} {zero}' for joint, sign, zero in mounted)}"

    def text(rows: Counts) -> str:
        return "\n".join([order, f"{len(rows)},", *(f"{_join(row)}," for row in rows)]) + "\n"

    binary = {BINARY: encode_table(file)} if file else {}
    return write_together(folder, {
        GOALS: text(table.goals),
        SPEEDS: text(table.speeds),
        DWELLS: text(table.dwells_ms[:, None]),
        HEADER: _c_header(table, ids),
        **binary,
    })


def read_tables(folder: str | Path) -> PoseTable:
    """Reads the three text files back, goals as counts of the joints; InputError where they disagree, or lack the line that says
    the order of joints."""
    folder = Path(folder)
    (joints, units, sections, mountings), goals = _read(folder / GOALS)
    columns = {SPEEDS: len(joints), DWELLS: 1}
    counts = {}
    for name, width in columns.items():
        (order, families, again, _), counts[name] = _read(folder / name, width)
        if order != joints:
            raise InputError(folder / name, f"line 1: joints are not in the order of {GOALS}")
        if families != units:
            raise InputError(folder / name, f"line 2: servos are not those of {GOALS}")
        if again != sections:
            raise InputError(folder / name, f"line '{SECTIONS} …': not that of {GOALS}")
        if len(counts[name]) != len(goals):
            raise InputError(folder / name, f"{len(counts[name])} poses, but {len(goals)} in {GOALS}")
    table = PoseTable(joints, goals, counts[SPEEDS], counts[DWELLS][:, 0], str(folder), units, *sections)
    return in_joint_counts(table, mountings)


Order = tuple[tuple[str, ...], tuple[ServoUnits, ...], tuple[int, int], Mapping[str, Mounting]]
"""The joints, the units of their servos, how many poses are of the start and of the stop, and how servos are mounted."""


def _read(path: Path, width: int | None = None) -> tuple[Order, Counts]:
    """Content of the first lines, and a row of `width` counts (default: one for each joint) for each pose."""
    lines = [line.strip() for line in read_text(path).splitlines() if line.strip()]
    if not lines or not lines[0].startswith(ORDER):
        raise InputError(path, f"line 1: expected '{ORDER} …', the order of joints")
    joints = tuple(lines[0].removeprefix(ORDER).split())
    units, first = (AX12A,) * len(joints), 1
    if lines[1:] and lines[1].startswith(FAMILIES):
        units, first = _units(path, re.split(r",\s*", lines[1].removeprefix(FAMILIES).strip()), len(joints)), 2
    sections = (0, 0, 0)
    if lines[first:] and lines[first].startswith(SECTIONS):
        sections, first = _sections(path, lines[first], first + 1), first + 1
    mountings: dict[str, Mounting] = {}
    if lines[first:] and lines[first].startswith(MOUNTED):
        mountings, first = _mountings(path, lines[first], first + 1, joints), first + 1
    rows: list[list[int]] = []
    for n, line in enumerate(lines[first:], start=first + 1):
        rows.append([])
        for cell in re.split(r"[,\s]+", line.strip(", ")):
            value = whole_of(cell)
            if value is None or value > _MOST:
                raise InputError(path, f"line {n}: expected whole numbers up to {_MOST}, found '{cell[:40]}'")
            rows[-1].append(value)
    if not rows or rows[0] != [len(rows) - 1]:
        raise InputError(path, f"line {first + 1}: expected the number of poses, and {max(len(rows) - 1, 0)} follow")
    for k, row in enumerate(rows[1:], start=1):
        if len(row) != (width or len(joints)):
            raise InputError(path, f"pose {k}: expected {width or len(joints)} numbers, found {len(row)}")
    if any(sections) and sum(sections) != len(rows) - 1:
        raise InputError(path, f"line '{SECTIONS} …': says {sum(sections)} poses, and {len(rows) - 1} follow")
    return (joints, units, (sections[0], sections[2]), mountings), np.array(rows[1:], dtype=np.int64)


def _mountings(path: Path, line: str, n: int, joints: Sequence[str]) -> dict[str, Mounting]:
    out = {}
    for entry in line.removeprefix(MOUNTED).strip().split(","):
        found = re.fullmatch(r"(\S+) ([+-]1) (\d{1,9})", entry.strip())
        if found is None or found[1] not in joints:
            raise InputError(path, f"line {n}: expected '{MOUNTED} JOINT +1 or -1 COUNT, …', found '{entry.strip()[:60]}'")
        out[found[1]] = Mounting(int(found[2]), zero=int(found[3]))
    return out


def _sections(path: Path, line: str, n: int) -> tuple[int, int, int]:
    found = re.fullmatch(r"start (\d{1,9}) loop (\d{1,9}) stop (\d{1,9})", line.removeprefix(SECTIONS).strip())
    if found is None:
        raise InputError(path, f"line {n}: expected '{SECTIONS} start A loop B stop C', found '{line[:60]}'")
    start, loop, stop = map(int, found.groups())
    return start, loop, stop


def _units(path: Path, families: list[str], n: int) -> tuple[ServoUnits, ...]:
    if len(families) != n:
        raise InputError(path, f"line 2: expected the families of {n} servos, found {len(families)}")
    try:
        return tuple(ServoUnits.of(servo_profile(family)) for family in families)
    except InputError as e:
        raise InputError(path, f"line 2: {e.problem}") from None


def _c_header(table: PoseTable, numbers: Mapping[str, int]) -> str:
    """Constant arrays for the controller's program; rows are poses, columns are joints in the order of motion_joints."""
    names = ", ".join(json.dumps(joint) for joint in table.joints)
    ids = _join([numbers[joint] for joint in table.joints], ", ")

    families = "\n".join(f"/* {units} */" for units in table.families)

    def rows(counts: Counts) -> str:
        return ",\n".join(f"    {{{_join(row, ', ')}}}" for row in counts)

    return f"""\
/* {len(table)} poses of {len(table.joints)} joints, for a program that sends each pose and then waits for its dwell: the start
   once, the loop again and again, the stop once.
   Written by the workbench; do not edit. Columns: {' '.join(table.joints)} */
#ifndef WORKBENCH_MOTION_H
#define WORKBENCH_MOTION_H

#include <stdint.h>

#define MOTION_POSES {len(table)}
#define MOTION_START_POSES {table.start}
#define MOTION_LOOP_POSES {table.loop}
#define MOTION_STOP_POSES {table.stop}
#define MOTION_JOINTS {len(table.joints)}

static const char *const motion_joints[MOTION_JOINTS] = {{{names}}};

static const uint8_t motion_bus_ids[MOTION_JOINTS] = {{{ids}}};

{families}

/* Goal positions. */
static const uint16_t motion_goals[MOTION_POSES][MOTION_JOINTS] = {{
{rows(table.goals)}
}};

/* Moving speeds. */
static const uint16_t motion_speeds[MOTION_POSES][MOTION_JOINTS] = {{
{rows(table.speeds)}
}};

/* What to wait after each pose, ms. */
static const uint32_t motion_dwells_ms[MOTION_POSES] = {{{_join(table.dwells_ms, ', ')}}};

#endif
"""


def _join(counts: Iterable[int], comma: str = ",") -> str:
    return comma.join(str(count) for count in counts)
