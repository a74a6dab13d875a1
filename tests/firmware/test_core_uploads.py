"""Uploads and tables at the edges of what the core takes: sequence numbers, silence, bounds, reach, sizes."""

from __future__ import annotations

import ctypes
import struct
import zlib
from collections.abc import Sequence

import pytest

from tests.firmware.native import Sim, core, walk
from tests.firmware.test_core_play import changed, upload
from workbench.device.link import AnswerMessage, FrameType, encode_frame, upload_frames
from workbench.device.tables.table_file import decode_table
from workbench.files import InputError

TABLE = walk()
PLAY = 5


def test_sequence_numbers_are_ahead_by_less_than_half_the_circle() -> None:
    for ahead, taken in ((1, True), (127, True), (128, False), (255, False), (0, False)):
        sim = Sim(TABLE)
        sim.play()
        assert upload(sim, changed(3), 200).well
        assert upload(sim, changed(4), (200 + ahead) % 256).well == taken


def test_an_upload_is_forgotten_after_two_seconds_of_silence() -> None:
    for silence, result in ((1990, "bytes are missing"), (2010, "no upload is under way")):
        sim = Sim(TABLE)
        sim.to_neutral()
        sim.send(upload_frames(changed(3), 1)[0])
        sim.run(silence)
        sim.messages()
        sim.send(encode_frame(FrameType.END))
        sim.run(5)
        assert [m.result for m in sim.messages() if isinstance(m, AnswerMessage)] == [result]


def of_one_pose(ids: Sequence[int], dwell: int = 140, goal: int = 512, speed: int = 5) -> bytes:
    """A whole table of joints with these bus IDs; their speed may be as high as a servo's register."""
    body = struct.pack("<4sBBHHHI", b"WBTB", 1, len(ids), 1, 0, 0, 24 + 16 * len(ids))
    body += b"".join(struct.pack("<BBHHHHH", bus_id, 0, 12, 0, 1023, 1023, 512) for bus_id in ids)
    body += struct.pack("<I", dwell) + struct.pack("<HH", goal, speed) * len(ids)
    return body + struct.pack("<I", zlib.crc32(body))


@pytest.mark.parametrize(("joints", "accepted"), [(0, False), (1, True), (26, True), (27, False)])
def test_a_table_has_one_to_26_joints(joints: int, accepted: bool) -> None:
    data = of_one_pose(range(joints))
    assert (core().table_check(data, len(data)) == 0) == accepted


@pytest.mark.parametrize("speed", [0, 440, 441, 1023])
def test_no_joint_is_thought_faster_than_one_that_goes_at_once(speed: int) -> None:
    """999 counts a second, 139 in 140 ms; a tenth and 8 counts more are granted."""
    reach = core().table_reachable
    reach.restype = ctypes.c_bool
    for away, reached in ((139 + 13 + 8, True), (139 + 13 + 9, False)):
        assert reach(of_one_pose([1], goal=300 + away, speed=speed), (ctypes.c_uint16 * 26)(300)) == reached


@pytest.mark.parametrize(("dwell", "bus_id", "accepted"), [
    (10, 253, True), (9, 253, False), (600_000, 0, True), (600_001, 0, False), (100, 254, False)])
def test_the_table_at_its_bounds(dwell: int, bus_id: int, accepted: bool) -> None:
    data = of_one_pose([bus_id], dwell)
    assert (core().table_check(data, len(data)) == 0) == accepted
    if accepted:
        decode_table(data)
    else:
        with pytest.raises(InputError):
            decode_table(data)


def test_first_pose_at_the_edge_of_reach() -> None:
    """At 140 ms and speed 159 a joint comes 50 counts far; a tenth and 8 counts more are granted."""
    reach = 159 * 2271 // 1000 * 140 // 1000
    for beyond, fault in ((0, 0), (1, 15)):
        last = decode_table(TABLE).table.goals[3]
        first = last.copy()
        first[0] = last[0] + reach + reach // 10 + 8 + beyond
        sim = Sim(TABLE)
        sim.play()
        assert upload(sim, changed(first=first), 1).well
        sim.run(600)
        assert (sim.get("state"), sim.get("table_fault")) == (PLAY, fault)


def test_data_beyond_the_size_that_was_said_are_refused() -> None:
    sim = Sim(TABLE)
    sim.to_neutral()
    sim.send(encode_frame(FrameType.BEGIN, struct.pack("<IIBB", 250, 0, 1, 0)))
    sim.send(encode_frame(FrameType.DATA, struct.pack("<H", 0) + bytes(200)))
    sim.run(5)
    sim.messages()
    sim.send(encode_frame(FrameType.DATA, struct.pack("<H", 200) + bytes(51)))
    sim.run(5)
    assert [m.result for m in sim.messages() if isinstance(m, AnswerMessage)] == ["bytes are missing"]
