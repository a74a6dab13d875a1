"""Uploads and tables at the edges of what the core takes: sequence numbers, silence, bounds, reach, sizes."""

from __future__ import annotations

import struct
import zlib

import pytest

from tests.firmware.native import Sim, core, walk
from tests.firmware.test_core_play import changed, upload
from workbench.device.link import AnswerMessage, FrameType, frame, upload_frames
from workbench.device.table_file import decode_table
from workbench.robot import InputError

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
        sim.send(frame(FrameType.END))
        sim.run(5)
        assert [m.result for m in sim.messages() if isinstance(m, AnswerMessage)] == [result]


@pytest.mark.parametrize(("dwell", "bus_id", "accepted"), [
    (10, 253, True), (9, 253, False), (600_000, 0, True), (600_001, 0, False), (100, 254, False)])
def test_the_table_at_its_bounds(dwell: int, bus_id: int, accepted: bool) -> None:
    body = struct.pack("<4sBBHHHI", b"WBTB", 1, 1, 1, 0, 0, 40) + struct.pack("<BBHHHHH", bus_id, 0, 12, 512, 512, 5, 512)
    body += struct.pack("<IHH", dwell, 512, 5)
    data = body + struct.pack("<I", zlib.crc32(body))
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
    sim.send(frame(FrameType.BEGIN, struct.pack("<IIBB", 250, 0, 1, 0)))
    sim.send(frame(FrameType.DATA, struct.pack("<H", 0) + bytes(200)))
    sim.run(5)
    sim.messages()
    sim.send(frame(FrameType.DATA, struct.pack("<H", 200) + bytes(51)))
    sim.run(5)
    assert [m.result for m in sim.messages() if isinstance(m, AnswerMessage)] == ["bytes are missing"]
