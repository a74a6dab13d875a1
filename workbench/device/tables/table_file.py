"""The binary table for the controller, compiled into its program or sent to it (layout in docs/robot.md)."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from workbench.device.tables.mounted import in_servo_counts, zeros
from workbench.files import InputError
from workbench.files.reading import read_bytes
from workbench.motion import PoseTable
from workbench.robot import BUS_IDS, RobotModel, bus_ids
from workbench.robot.mounting import Mounting
from workbench.robot.names import HIGHEST_BUS_ID
from workbench.robot.ranges import joint_ranges
from workbench.robot.servo_units import AX12A

MAGIC = b"WBTB"
VERSION, SECTIONS_VERSION = 1, 2
"""A table with a start or a stop says how many poses they have, behind the same head."""
STOPS = 1
"""Flag of a table that ends after its cycles; without it the table repeats."""
AX12A_NUMBER = 12
"""The AX-12A's model number in its register."""
CENTRE, LARGEST = AX12A.centre, AX12A.highest
"""Counts of angle zero and of the largest goal and speed."""
MOST_JOINTS = 26
"""A Sync Write of goal and speed stays below the AX-12A's receive buffer of 143 bytes."""
MOST_BYTES = 4096
"""Longest table that the controller's program has room for, over a link or built in (firmware/core/limits.h)."""
SHORTEST_MS, LONGEST_MS = 10, 600_000
"""Dwells: a Sync Write, its verification and a repair have to fit in; longer than ten minutes is a mistake [ms]."""

_HEAD = struct.Struct("<4sBBHHHI")
_SECTIONS = struct.Struct("<HH")
_JOINT = struct.Struct("<BBHHHHH")


@dataclass(frozen=True)
class JointBounds:
    """Limits that the controller enforces for a joint: bus ID, model number of its servo, goals from `low` to `high`, moving
    speed up to `fastest`, and neutral [all in the servo's own counts]. direction: -1 where the servo turns against its joint; the
    controller has no use for it, and a binary table does not hold it."""

    bus_id: int
    model_number: int = AX12A_NUMBER
    low: int = 0
    high: int = LARGEST
    fastest: int = LARGEST
    neutral: int = CENTRE
    direction: int = 1


@dataclass(frozen=True)
class TableFile:
    """A pose table, in the servos' own counts, with its safety limits. joints: as many as the table's columns. cycles:
    how many, where `stops`; else the table repeats until it is stopped or another comes."""

    table: PoseTable
    joints: tuple[JointBounds, ...]
    cycles: int = 0
    stops: bool = False


def bounds_of(table: PoseTable, model: RobotModel) -> tuple[JointBounds, ...]:
    """Bounds of a model's joints in counts, no narrower than the table's own goals (`export` has checked it, or was forced).

    InputError for a table that the controller's program cannot play.
    """
    other = unplayable(table)
    if other:
        raise InputError(table.source, other)
    ids, ranges = bus_ids(model), joint_ranges(model)
    bounds, neutral = [], zeros(table, model.mountings)
    for i, joint in enumerate(table.joints):
        servo, limits = model.servo(joint), (ranges[joint].lower, ranges[joint].upper)
        low, high = (min(max(round(CENTRE + limit / AX12A.count), 0), LARGEST) if math.isfinite(limit) else edge
                     for limit, edge in zip(limits, (0, LARGEST)))
        low, high = min(low, CENTRE, int(table.goals[:, i].min())), max(high, CENTRE, int(table.goals[:, i].max()))
        sign, zero = model.mountings.get(joint, Mounting()).direction, neutral[i]
        ends = sorted(min(max(zero + sign * (end - CENTRE), 0), LARGEST) for end in (low, high))
        no_load = float(servo.line.no_load_speed)
        bounds.append(JointBounds(
            ids[joint], AX12A_NUMBER, low=ends[0], high=ends[1],
            fastest=max(1, min(LARGEST, round(no_load / AX12A.speed_unit)), int(table.speeds[:, i].max())),
            neutral=zero, direction=sign))
    return tuple(bounds)


def table_file(table: PoseTable, model: RobotModel, cycles: int = 0, stops: bool = False) -> TableFile:
    """A motion's table for the controller, with every joint of the model in order of their names; those that the motion leaves
    out are held in neutral, as the computer's player holds them, and are read. InputError as `bounds_of`."""
    absent = [joint for joint in model.joints if joint not in table.joints and joint in bus_ids(model)]
    if any(table.units[0] != u for u in table.units) or table.units[0] != AX12A:
        absent = []  # not playable anyway
    goals = np.hstack([table.goals, np.full((len(table), len(absent)), CENTRE)])
    speeds = np.hstack([table.speeds, np.zeros((len(table), len(absent)), dtype=np.int64)])
    joints = (*table.joints, *absent)
    order = np.argsort(joints)
    whole = replace(table, joints=tuple(joints[k] for k in order), goals=goals[:, order], speeds=speeds[:, order],
                    units=(AX12A,) * len(joints) if absent else table.units)
    return TableFile(in_servo_counts(whole, model.mountings), bounds_of(whole, model), cycles, stops)


def unplayable(table: PoseTable) -> str:
    """Why the controller's program cannot play a table (another servo family, or more poses than fit); "" where it can."""
    return other_family(table) or too_long(len(table.joints), len(table))


def other_family(table: PoseTable) -> str:
    """A line about the first servo that is not of the AX-12A's family, the only one that the controller's program knows; "" if
    none."""
    others = [(j, u.family) for j, u in zip(table.joints, table.units) if u != AX12A]
    if not others:
        return ""
    joint, family = others[0]
    return f"joint {joint} has a servo of the family {family}; the CM-530's program plays the AX-12A's alone"


def too_long(joints: int, poses: int) -> str:
    """A line that says how many poses fit, if so many of so many joints do not fit into the controller; "" if they do."""
    size = table_bytes(joints, poses)
    if size <= MOST_BYTES:
        return ""
    return (f"{poses} poses of {joints} joints make a table of {size} bytes; the CM-530's program takes {MOST_BYTES} "
            f"({most_poses(joints)} poses)")


def table_bytes(joints: int, poses: int, sections: bool = False) -> int:
    """Size of a binary table [bytes]. sections: it has a start or a stop."""
    return _HEAD.size + (_SECTIONS.size if sections else 0) + _JOINT.size * joints + (4 + 4 * joints) * poses + 4


def most_poses(joints: int) -> int:
    """How many poses of so many joints the controller's program takes in one table."""
    return max(MOST_BYTES - table_bytes(joints, 0), 0) // (table_bytes(joints, 1) - table_bytes(joints, 0))


def encode_table(file: TableFile) -> bytes:
    """The bytes of a table; InputError where the format cannot hold it."""
    table = file.table
    flags = STOPS if file.stops else 0
    if len(file.joints) != len(table.joints):
        raise InputError(table.source, f"bounds of {len(file.joints)} joints for {len(table.joints)} columns")
    if len(table) > 0xFFFF or not 0 <= file.cycles <= 0xFFFF:
        raise InputError(table.source, f"{len(table)} poses, {file.cycles} cycles: expected at most 65535 of each")
    sections = bool(table.start or table.stop)
    size = table_bytes(len(file.joints), len(table), sections)
    version = SECTIONS_VERSION if sections else VERSION
    parts = [_HEAD.pack(MAGIC, version, len(file.joints) & 0xFF, len(table), flags, file.cycles, size)]
    if sections:
        parts.append(_SECTIONS.pack(table.start, table.stop))
    try:
        parts += [_JOINT.pack(j.bus_id, 0, j.model_number, j.low, j.high, j.fastest, j.neutral) for j in file.joints]
        for dwell, goals, speeds in zip(table.dwells_ms, table.goals, table.speeds):
            parts.append(struct.pack("<I", dwell) + np.column_stack([goals, speeds]).astype("<u2").tobytes())
    except struct.error as e:
        raise InputError(table.source, f"a bound or dwell does not fit the binary table ({e})") from None
    body = b"".join(parts)
    data = body + struct.pack("<I", zlib.crc32(body))
    decode_table(data, source=table.source)  # what the controller would refuse is never written
    return data


def decode_table(data: bytes, names: Mapping[int, str] | None = None, source: str = "table") -> TableFile:
    """The table in these bytes; InputError describes the error, exactly where the controller's program refuses them.

    names: joint by bus ID (default: the puppy's; others are called `id7`).
    """
    if len(data) < _HEAD.size:
        raise InputError(source, f"{len(data)} bytes: too short for a table")
    magic, version, n, poses, flags, cycles, size = _HEAD.unpack_from(data)
    if magic != MAGIC:
        raise InputError(source, f"starts with {magic!r}, expected {MAGIC!r}")
    if version not in (VERSION, SECTIONS_VERSION):
        raise InputError(source, f"version {version}; expected {VERSION} or {SECTIONS_VERSION}")
    sections = version == SECTIONS_VERSION
    if sections and len(data) < _HEAD.size + _SECTIONS.size:
        raise InputError(source, f"{len(data)} bytes: too short for a table with sections")
    start, stop = _SECTIONS.unpack_from(data, _HEAD.size) if sections else (0, 0)
    if not 1 <= n <= MOST_JOINTS or not poses:
        raise InputError(source, f"{poses} poses of {n} joints; expected at least one pose of 1 to {MOST_JOINTS} joints")
    if start + stop >= poses:
        raise InputError(source, f"{start} poses of start and {stop} of stop, of {poses} in all; expected a loop between them")
    if flags & ~STOPS or (flags & STOPS and not cycles):
        raise InputError(source, f"flags {flags:#x} with {cycles} cycles mean nothing")
    takes = table_bytes(n, poses, sections)
    if size != len(data) or size != takes:
        raise InputError(source, f"{len(data)} bytes, its head says {size}; {poses} poses of {n} joints take {takes}")
    head = _HEAD.size + (_SECTIONS.size if sections else 0)
    joints = _joints(data, n, head, source)
    if zlib.crc32(data[:-4]) != struct.unpack("<I", data[-4:])[0]:
        raise InputError(source, "its CRC-32 does not fit its content")
    table = _poses(data, joints, poses, head, names or {v: k for k, v in BUS_IDS.items()}, source)
    table = replace(table, start=start, stop=stop)
    return TableFile(table, joints, cycles, bool(flags & STOPS))


def read_table_file(path: str | Path, names: Mapping[int, str] | None = None) -> TableFile:
    """Reads a binary table; InputError where it cannot be read or is none."""
    return decode_table(read_bytes(path), names, str(path))


def _joints(data: bytes, n: int, head: int, source: str) -> tuple[JointBounds, ...]:
    joints: list[JointBounds] = []
    for k in range(n):
        bus_id, zero, number, low, high, fastest, neutral = _JOINT.unpack_from(data, head + _JOINT.size * k)
        place = f"joint {k + 1}"
        if bus_id > HIGHEST_BUS_ID or zero or bus_id in [j.bus_id for j in joints]:
            raise InputError(source, f"{place}: bus ID {bus_id} is above {HIGHEST_BUS_ID}, or there twice, "
                                     "or the byte after it is not 0")
        if not low <= neutral <= high <= LARGEST or not 1 <= fastest <= LARGEST:
            raise InputError(source, f"{place}: bounds {low} to {high} about {neutral}, speeds up to {fastest}, make no sense")
        joints.append(JointBounds(bus_id, number, low, high, fastest, neutral))
    return tuple(joints)


def _poses(data: bytes, joints: Sequence[JointBounds], poses: int, head: int, names: Mapping[int, str],
           source: str) -> PoseTable:
    n = len(joints)
    rows = np.frombuffer(data, np.uint8, (4 + 4 * n) * poses, head + _JOINT.size * n).reshape(poses, -1)
    dwells = rows[:, :4].copy().view("<u4")[:, 0].astype(np.int64)
    counts = rows[:, 4:].copy().view("<u2").reshape(poses, n, 2).astype(np.int64)
    goals, speeds = counts[..., 0], counts[..., 1]
    for k, dwell in enumerate(dwells):
        if not SHORTEST_MS <= dwell <= LONGEST_MS:
            raise InputError(source, f"pose {k + 1}: dwell of {dwell} ms; the controller plays {SHORTEST_MS} to {LONGEST_MS} ms")
        for i, joint in enumerate(joints):
            place, goal, speed = f"pose {k + 1}, bus ID {joint.bus_id}", goals[k, i], speeds[k, i]
            if not joint.low <= goal <= joint.high:
                raise InputError(source, f"{place}: goal {goal} is outside {joint.low} to {joint.high}")
            if speed > joint.fastest:
                raise InputError(source, f"{place}: speed {speed} is above {joint.fastest}")
    return PoseTable(tuple(names.get(j.bus_id, f"id{j.bus_id}") for j in joints), goals, speeds, dwells, source)
