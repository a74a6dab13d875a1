"""The binary table: written and read by Python, read by the firmware's own C; both refuse the same."""

from __future__ import annotations

import ctypes
import re
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.firmware.native import FIRMWARE, core, walk
from workbench.device import export, read_table_file
from workbench.device.tables.table_file import (
    MOST_BYTES,
    JointBounds,
    TableFile,
    decode_table,
    encode_table,
    most_poses,
    table_bytes,
    unplayable,
)
from workbench.files import InputError
from workbench.motion import Motion, PoseTable, load_motion
from workbench.robot import BUS_IDS, data_file, puppy_model

WALK = load_motion(data_file("robotis_walk.csv")).as_table()


def accepted_by_c(data: bytes) -> bool:
    buffer = ctypes.create_string_buffer(data, max(len(data), 1))
    return core().table_check(buffer, len(data)) == 0


def accepted_by_python(data: bytes) -> bool:
    try:
        decode_table(data)
    except InputError:
        return False
    return True


@st.composite
def tables(draw: st.DrawFn) -> TableFile:
    n, poses = draw(st.integers(1, 26)), draw(st.integers(1, 12))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    ids = rng.permutation(254)[:n]
    joints, goals = [], np.empty((poses, n), dtype=np.int64)
    for k in range(n):
        low, neutral, high = (int(x) for x in np.sort(rng.integers(0, 1024, 3)))
        joints.append(JointBounds(int(ids[k]), int(rng.integers(0, 65536)), low, high, int(rng.integers(1, 1024)), neutral))
        goals[:, k] = rng.integers(low, high + 1, poses)
    speeds = np.stack([rng.integers(0, j.fastest + 1, poses) for j in joints], axis=1)
    dwells = rng.integers(10, 600_001, poses)
    stops = bool(rng.integers(2))
    table = PoseTable(tuple(f"j{k}" for k in range(n)), goals, speeds, dwells)
    return TableFile(table, tuple(joints), int(rng.integers(1, 65536)) if stops else 0, stops)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(tables())
def test_written_by_python_read_by_both(file: TableFile) -> None:
    data = encode_table(file)
    assert accepted_by_c(data)
    back = decode_table(data)
    assert back.joints == file.joints
    assert (back.cycles, back.stops) == (file.cycles, file.stops)
    for name in ("goals", "speeds", "dwells_ms"):
        assert np.array_equal(getattr(back.table, name), getattr(file.table, name))


@settings(max_examples=400, deadline=None, derandomize=True)
@given(tables(), st.data())
def test_damaged_tables_are_refused_by_both_or_neither(file: TableFile, data: st.DataObject) -> None:
    body = bytearray(encode_table(file)[:-4])
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(body) - 1))
        body[at] = data.draw(st.integers(0, 255))
    cut = data.draw(st.sampled_from([0, 0, 0, 1, 4, 17]))
    damaged = bytes(body[: len(body) - cut])
    damaged += struct.pack("<I", zlib.crc32(damaged))  # the sum made right, so that the rest is looked at
    assert accepted_by_c(damaged) == accepted_by_python(damaged)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.binary(max_size=300))
def test_noise_is_refused_by_both(data: bytes) -> None:
    assert not accepted_by_c(data)
    assert not accepted_by_python(data)
    assert accepted_by_c(b"WBTB" + data) == accepted_by_python(b"WBTB" + data)


def test_any_single_flipped_bit_is_found() -> None:
    data = walk()
    for bit in range(8 * len(data)):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        assert not accepted_by_c(bytes(flipped))
    assert not accepted_by_python(bytes(flipped))


def test_the_built_in_table_is_the_robotis_walk_as_export_writes_it() -> None:
    assert (FIRMWARE / "robotis_walk.table").read_bytes() == walk()
    file = read_table_file(FIRMWARE / "robotis_walk.table")
    assert file.table.joints == WALK.joints
    assert [j.bus_id for j in file.joints] == [BUS_IDS[j] for j in WALK.joints]
    assert np.array_equal(file.table.goals, WALK.goals)
    assert np.array_equal(file.table.speeds, WALK.speeds)
    assert list(file.table.dwells_ms) == [140, 103, 94, 131]


@pytest.mark.parametrize(("change", "said"), [
    (lambda d: d[:10], "too short"), (lambda d: b"X" + d[1:], "expected b'WBTB'"), (lambda d: d + b"\0", "bytes, its head says"),
    (lambda d: d[:21] + b"\xff" + d[22:], "make no sense"), (lambda d: d[:-1] + b"\0", "CRC-32"),
])
def test_what_is_wrong_is_said_in_one_line(tmp_path: Path, change, said) -> None:
    path = tmp_path / "motion.table"
    path.write_bytes(change(walk()))
    with pytest.raises(InputError, match=said) as caught:
        read_table_file(path)
    assert str(path) in str(caught.value)


def test_what_the_controller_would_not_play_is_not_written() -> None:
    short = PoseTable(("blb",), np.array([[512]]), np.array([[5]]), np.array([9]))
    with pytest.raises(InputError, match="dwell of 9 ms"):
        encode_table(TableFile(short, (JointBounds(15),)))
    high = PoseTable(("blb",), np.array([[900]]), np.array([[5]]), np.array([50]))
    with pytest.raises(InputError, match="goal 900 is outside 100 to 800"):
        encode_table(TableFile(high, (JointBounds(15, low=100, high=800),)))


@pytest.mark.parametrize(("joints", "poses"), [(15, 60), (1, 508), (26, 34)])
def test_one_limit_for_the_workbench_and_the_controllers_program(joints: int, poses: int) -> None:
    (limit,) = re.findall(r"#define TABLE_BYTES (\d+)u", (FIRMWARE / "core" / "limits.h").read_text())
    assert int(limit) == MOST_BYTES
    assert most_poses(joints) == poses
    for count in (poses, poses + 1):
        goals = np.full((count, joints), 512)
        names = tuple(f"j{k}" for k in range(joints))
        table = PoseTable(names, goals, np.full_like(goals, 5), np.full(count, 50))
        data = encode_table(TableFile(table, tuple(JointBounds(k + 1) for k in range(joints))))
        assert len(data) == table_bytes(joints, count)
        assert (len(data) > MOST_BYTES) == bool(unplayable(table))


def test_a_table_that_is_too_long_for_the_controller_is_exported_without_its_binary_and_said(tmp_path: Path) -> None:
    times = np.arange(62) * 0.2
    motion = Motion("long", times, WALK.joints, np.zeros((62, 15)))
    exported = export(motion, puppy_model(), tmp_path)
    assert "motion.table" not in [f.name for f in exported.files]
    assert exported.no_binary == "61 poses of 15 joints make a table of 4104 bytes; the CM-530's program takes 4096 (60 poses)"
