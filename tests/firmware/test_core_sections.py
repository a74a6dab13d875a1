"""The native core with a start, a loop and a stop: what is played in which order, what a stop does, tables of both versions."""

from __future__ import annotations

import struct
import zlib
from dataclasses import replace

import numpy as np
import pytest

from tests.firmware.native import Sim, core, walk
from tests.firmware.test_core_play import upload
from workbench.device.link import REASONS, FrameType, encode_frame
from workbench.device.tables.table_file import TableFile, decode_table, encode_table, table_file
from workbench.files import InputError
from workbench.motion import PoseTable
from workbench.robot import puppy_model

TABLE = walk()
NEUTRAL, PLAY, STOP = 4, 5, 6


def sections(start: int = 2, loop: int = 3, stop: int = 2, cycles: int = 2, stops: bool = True, shift: int = 0) -> bytes:
    """Pose k has joint 0 at 512 + shift + 4 (k + 1), all others in neutral, 60 ms each."""
    n = start + loop + stop
    file = decode_table(TABLE)
    goals = np.full((n, 15), 512)
    goals[:, 0] = 512 + shift + 4 * (1 + np.arange(n))
    table = PoseTable(file.table.joints, goals, np.full((n, 15), 100), np.full(n, 60), start=start, stop=stop)
    return encode_table(TableFile(table, file.joints, cycles if stops else 0, stops))


def played(sim: Sim, ms: int, shift: int = 0) -> list[int]:
    """Indices of the poses in the order in which they go out."""
    seen: list[int] = []
    for _ in range(ms):
        sim.run(1)
        sim.received()
        pose = (sim.get("goal", 0) - 512 - shift) // 4 - 1
        if sim.get("state") == PLAY and pose >= 0 and (not seen or seen[-1] != pose):
            seen.append(pose)
    return seen


def test_start_once_loop_so_often_stop_once_then_neutral() -> None:
    sim = Sim(sections())
    sim.to_neutral()
    sim.send(encode_frame(FrameType.PLAY))
    assert played(sim, 2500) == [0, 1, 2, 3, 4, 2, 3, 4, 5, 6]
    assert (sim.get("state"), REASONS[sim.get("reason")]) == (NEUTRAL, "the table came to its end")
    sim.send(encode_frame(FrameType.PLAY))
    assert played(sim, 2500) == [0, 1, 2, 3, 4, 2, 3, 4, 5, 6]


@pytest.mark.parametrize(("after", "order"), [
    (30, [0, 1, 5, 6]), (150, [0, 1, 2, 3, 4, 5, 6]), (400, [0, 1, 2, 3, 4, 2, 3, 4, 5, 6])])
def test_a_stop_is_the_tables_own_after_the_cycle(after: int, order: list[int]) -> None:
    sim = Sim(sections(stops=False))
    sim.to_neutral()
    sim.send(encode_frame(FrameType.PLAY))
    sim.run(1)
    before = played(sim, after)
    sim.send(encode_frame(FrameType.STOP))
    seen = before + played(sim, 2500)
    assert [k for i, k in enumerate(seen) if i == 0 or seen[i - 1] != k] == order
    assert (sim.get("state"), REASONS[sim.get("reason")]) == (NEUTRAL, "PC link")


def test_a_second_stop_and_a_release_end_it_at_once() -> None:
    for second, state in ((FrameType.STOP, STOP), (FrameType.RELEASE, 1)):
        sim = Sim(sections(stops=False))
        sim.to_neutral()
        sim.send(encode_frame(FrameType.PLAY))
        sim.run(200)
        sim.send(encode_frame(FrameType.STOP))
        sim.run(3)
        assert sim.get("state") == PLAY
        sim.send(encode_frame(second))
        sim.run(5)
        assert sim.get("state") == state


def test_another_table_is_entered_at_its_loop_in_the_walk() -> None:
    sim = Sim(sections(stops=False))
    sim.to_neutral()
    sim.send(encode_frame(FrameType.PLAY))
    sim.run(300)
    assert upload(sim, sections(3, 2, 1, stops=False, shift=1), 1).well
    sim.run(200)
    seen = played(sim, 600, shift=1)
    assert set(seen) == {3, 4}
    sim.send(encode_frame(FrameType.STOP))
    assert played(sim, 1500, shift=1)[-1] == 5


def test_one_table_in_both_languages() -> None:
    check = core().table_check
    for start, loop, stop in ((0, 4, 0), (1, 1, 0), (0, 1, 3), (2, 3, 2)):
        data = sections(start, loop, stop)
        assert data[4] == (2 if start or stop else 1)
        assert check(data, len(data)) == 0
        table = decode_table(data).table
        assert (table.start, table.loop, table.stop) == (start, loop, stop)
    good = sections()
    for counts in ((7, 0), (0, 7), (3, 4), (0xFFFF, 0xFFFF)):
        body = good[:16] + struct.pack("<HH", *counts) + good[20:-4]
        data = body + struct.pack("<I", zlib.crc32(body))
        assert check(data, len(data)) != 0
        with pytest.raises(InputError, match="expected a loop between them"):
            decode_table(data)
    for cut in range(24):
        assert check(good[:cut], cut) != 0


def test_a_table_of_few_joints_holds_the_others_in_neutral_and_keeps_its_sections() -> None:
    table = PoseTable(("tail", "head"), np.array([[500, 520], [530, 512], [512, 512]]), np.full((3, 2), 40), np.full(3, 200),
                      start=1, stop=1)
    file = table_file(table, puppy_model(), 3, True)
    assert file.table.joints == decode_table(TABLE).table.joints
    assert (file.table.start, file.table.loop, file.table.stop) == (1, 1, 1)
    assert file.table.goals[:, -1].tolist() == [500, 530, 512]
    assert np.all(file.table.goals[:, :12] == 512)
    data = encode_table(file)
    sim = Sim(data)
    sim.set("mute", 1, 2)  # a joint that the motion does not name is looked after, too
    sim.run(2200)
    assert (sim.get("state"), sim.get("servo_named")) == (1, sim.get("id", 2))
    assert table_file(replace(decode_table(TABLE).table, source="x"), puppy_model()).joints == decode_table(TABLE).joints


def test_the_lights_blink_the_reasons_number() -> None:
    light = core().reason_light
    for reason in range(26):
        for tens, wanted in ((True, reason // 10), (False, reason % 10)):
            on = [bool(light(reason, 128 * k, tens) & 1) for k in range(64)]
            assert sum(now and not before for before, now in zip([False, *on], on)) == wanted
            assert sum(on) == 2 * wanted
