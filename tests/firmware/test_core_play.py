"""The native core at play: pose times, read-back and repair, telemetry, commands, uploads, bridge."""

from __future__ import annotations

import random
import struct

import numpy as np
import pytest

from tests.firmware.native import LINK_PC, LINK_ZIGBEE, Sim, walk
from workbench.device.link import (
    AnswerMessage,
    ControllerState,
    FrameType,
    LogMessage,
    StateMessage,
    encode_frame,
    upload_frames,
)
from workbench.device.tables.table_file import TableFile, decode_table, encode_table
from workbench.motion import PoseTable

TABLE = walk()
DWELLS = (140, 103, 94, 131)


def changed(goal_shift: int = 0, poses: int = 4, first: int | None = None, **options: object) -> bytes:
    """The walk with goals shifted, repeated to so many poses, or with another first pose."""
    file = decode_table(TABLE)
    t = file.table
    order = np.arange(poses) % 4
    goals = t.goals[order] + goal_shift
    if first is not None:
        goals[0] = first
    table = PoseTable(t.joints, goals, t.speeds[order], t.dwells_ms[order])
    return encode_table(TableFile(table, file.joints, **options))


def goal_times(sim: Sim) -> list[int]:
    """Times of first Sync Writes of each pose [us]."""
    events = [k for k in range(sim.get("events")) if sim.get("event_kind", k) == 1 and sim.get("event_state", k) == 5]
    return [sim.get("event_us", k) for k in events if sim.get("event_resends", k) == 0]


def upload(sim: Sim, table: bytes, sequence: int, link: int = LINK_PC, ramps: bool = False) -> AnswerMessage:
    sim.messages(link)
    for data in upload_frames(table, sequence, ramps):
        sim.send(data, link)
    sim.run(30)
    answers = [m for m in sim.messages(link) if isinstance(m, AnswerMessage)]
    return answers[-1]


def test_poses_keep_their_times_to_the_tick_with_telemetry_on() -> None:
    sim = Sim(TABLE)
    sim.play()
    for _ in range(600):
        sim.run(50)
        sim.received()
    times = goal_times(sim)
    assert len(times) > 250
    expected = times[0] + 1000 * np.concatenate([[0], np.cumsum(np.tile(DWELLS, 100))])[: len(times)]
    assert max(abs(np.array(times) - expected)) == 0


def test_telemetry_brings_all_joints_at_forty_hertz_and_right_to_a_count() -> None:
    sim = Sim(TABLE)
    sim.play()
    logs = []
    history = {}
    for _ in range(5000):
        history[sim.get("us") // 1000] = [sim.get("position", j) for j in range(15)]
        sim.run(1)
        new = [m for m in sim.messages() if isinstance(m, LogMessage) and m.state == ControllerState.PLAY]
        for log in new:
            began = round(1000 * log.time)
            then = [history[t] for t in range(began, began + round(1000 * log.duration) + 1) if t in history]
            for j, position in enumerate(log.positions):
                assert not then or min(h[j] for h in then) - 1 <= position <= max(h[j] for h in then) + 1
        logs += new
    assert len(logs) >= 40 * 5 * 0.99
    assert {s.joint for m in logs[:6] for s in m.slow} == set(range(15))
    assert all(m.duration < 0.03 for m in logs)


def test_flips_towards_the_servos_never_leave_a_wrong_goal_for_50_ms() -> None:
    for seed in range(8):
        sim = Sim(TABLE, seed=seed)
        sim.play()
        sim.set("flip_to", 1000)
        for _ in range(1200):
            sim.run(50)
            sim.received()
        assert sim.get("state") == 5
        assert sim.get("poses") > 450
        assert sim.get("goal_errors") == 0
        assert 0 < sim.get("wrong_longest") <= 50


def test_flips_in_answers_stop_nothing() -> None:
    sim = Sim(TABLE, seed=3)
    sim.play()
    sim.set("flip_from", 1000)
    for _ in range(1200):
        sim.run(50)
        sim.received()
    assert (sim.get("state"), sim.get("reason")) == (5, 7)


@pytest.mark.slow
def test_flips_in_answers_stop_nothing_in_ten_thousand_poses() -> None:
    sim = Sim(TABLE, seed=4)
    sim.play()
    sim.set("flip_from", 1000)
    while sim.get("poses") < 10_000:
        sim.run(50)
        sim.received()
        assert (sim.get("state"), sim.get("reason")) == (5, 7)


def test_settings_that_a_broken_packet_changed_are_put_back() -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.set("slope", 128, 4)
    sim.run(60)
    assert sim.get("slope", 4) == 32


def test_remote_needs_two_words_and_one_returns_to_neutral() -> None:
    sim = Sim(TABLE)
    sim.to_neutral()
    sim.remote(1)
    sim.run(500)
    assert sim.get("state") == 4
    sim.run(1000)
    sim.remote(1)  # too late to belong to the first
    assert sim.get("state") == 4
    sim.remote(1)
    sim.run(300)
    assert sim.get("state") == 5
    sim.remote(16)
    sim.remote(0)
    sim.run(20)
    assert sim.get("state") == 6
    sim.to_neutral()
    sim.run(1500)
    assert all(abs(sim.get("position", j) - 512) <= 1 for j in range(15))
    sim.send(b"\xff\x55\x01\xfe\x00\xfe" * 3, LINK_ZIGBEE)  # a wrong complement
    sim.run(50)
    assert sim.get("state") == 4


def test_start_button_starts_and_stops_and_a_stuck_one_does_nothing() -> None:
    sim = Sim(TABLE)
    sim.set("start", 1)  # down when power came
    sim.to_neutral()
    sim.run(3000)
    assert sim.get("state") == 4
    sim.set("start", 0)
    sim.run(100)
    assert sim.get("state") == 4
    sim.set("start", 1)
    sim.run(5)
    sim.set("start", 0)  # a bounce
    sim.run(100)
    assert sim.get("state") == 4
    for expected in (5, 6):
        sim.set("start", 1)
        sim.run(80)
        sim.set("start", 0)
        sim.run(30)
        assert sim.get("state") == expected


def test_a_table_with_an_end_stops_in_neutral() -> None:
    sim = Sim(changed(cycles=2, stops=True))
    sim.play()
    sim.run(2 * sum(DWELLS) + 20)
    assert (sim.get("state"), sim.get("reason")) == (6, 9)
    sim.to_neutral()
    assert sim.get("poses") == 8


def test_upload_of_sixteen_poses_plays_within_a_cycle_and_250_ms() -> None:
    for wait in range(0, 470, 29):
        sim = Sim(TABLE, seed=wait)
        sim.play()
        sim.run(600 + wait)
        began = sim.get("us")
        new = changed(5, poses=16)
        answer = upload(sim, new, 1, ramps=False)
        assert answer.well
        took = (sim.get("us") - began) / 1000 - 30
        assert took < 250 or took < 1.1 * 10 * (len(new) + 90) / 57.6, took
        for _ in range(1000):
            if sim.get("goal", 0) == 417:
                break
            sim.run(1)
        assert (sim.get("us") - began) / 1000 <= sum(DWELLS) + max(250, took)
        assert sim.get("state") == 5


def test_upload_over_zigbee_and_one_link_at_a_time() -> None:
    sim = Sim(TABLE)
    sim.play()
    frames = upload_frames(changed(5), 1)
    sim.send(frames[0], LINK_ZIGBEE)
    sim.send(upload_frames(changed(4), 2)[0], LINK_PC)
    sim.run(20)
    assert [m.result for m in sim.messages() if isinstance(m, AnswerMessage)] == ["another upload is under way"]
    for data in frames[1:]:
        sim.send(data, LINK_ZIGBEE)
    sim.run(20)
    assert [m.well for m in sim.messages(LINK_ZIGBEE) if isinstance(m, AnswerMessage)] == [True, True]
    sim.run(600)
    assert sim.get("goal", 12) == 517


def test_a_table_out_of_reach_is_dropped_or_ramped_to() -> None:
    far = changed(first=800)
    sim = Sim(TABLE)
    sim.play()
    assert upload(sim, far, 1).well
    sim.run(600)
    assert (sim.get("state"), sim.get("table_fault")) == (5, 15)
    assert sim.get("goal", 0) != 800
    assert upload(sim, far, 2, ramps=True).well
    states = set()
    for _ in range(100):
        sim.run(20)
        states.add(sim.get("state"))
    assert states == {3, 5}
    assert sim.get("table_fault") == 0


def test_stale_foreign_big_and_broken_uploads_are_refused_with_the_reason() -> None:
    sim = Sim(TABLE)
    sim.play()
    assert upload(sim, changed(10), 5).well
    assert upload(sim, changed(10), 5).result == "no upload is under way"  # its BEGIN was refused: the number was there before
    assert upload(sim, changed(10), 200).result == "no upload is under way"
    other = bytearray(changed(10)[:-4])
    other[16] = 77
    import zlib
    foreign = bytes(other) + struct.pack("<I", zlib.crc32(bytes(other)))
    assert upload(sim, foreign, 6).result == "for another robot"
    sim.send(encode_frame(FrameType.BEGIN, struct.pack("<IIBB", 5000, 0, 7, 0)))
    sim.run(5)
    assert [m.result for m in sim.messages() if isinstance(m, AnswerMessage)] == ["too big"]
    assert upload(sim, changed(10)[:-1] + b"\0", 7).result == "CRC"  # its own, in a frame that is right
    frames = upload_frames(changed(10, poses=16), 8)
    for data in [*frames[:2], *frames[3:]]:
        sim.send(data)
    sim.run(30)
    assert "bytes are missing" in [m.result for m in sim.messages() if isinstance(m, AnswerMessage)]


def uploads(count: int, seed: int) -> None:
    """Random, cut, mixed and repeated uploads: only whole and fitting tables are ever played."""
    rng = random.Random(seed)
    sim = Sim(TABLE, seed=seed)
    sim.play()
    valid = {shift: changed(shift, poses=rng.choice((1, 2, 4))) for shift in range(-8, 9, 4)}
    goals = {tuple(row) for table in (*valid.values(), TABLE) for row in decode_table(table).table.goals.tolist()}
    sequence, taken = 0, 0
    for _ in range(count):
        sequence = (sequence + rng.choice((0, 1, 1, 1, 200))) % 256
        frames = upload_frames(rng.choice(list(valid.values())), sequence, ramps=True)
        kind = rng.randrange(6)
        if kind == 1:
            frames = frames[: rng.randrange(len(frames))]
        elif kind == 2:
            frames.insert(rng.randrange(len(frames)), rng.choice(upload_frames(valid[-8], sequence)))
        elif kind == 3:
            rng.shuffle(frames)
        data = b"".join(frames)
        if kind == 4:
            broken = bytearray(data)
            for _ in range(rng.randrange(1, 4)):
                broken[rng.randrange(len(broken))] ^= 1 << rng.randrange(8)
            data = bytes(broken)
        elif kind == 5:
            data = data[: rng.randrange(len(data))]
        sim.send(data, rng.choice((LINK_PC, LINK_PC, LINK_ZIGBEE)))
        sim.run(rng.randrange(400))
        taken += sum(isinstance(m, AnswerMessage) and m.type == FrameType.END and m.well for m in sim.messages())
        sim.received(LINK_ZIGBEE)
        if sim.get("state") == 5 and sim.get("poses"):
            assert tuple(sim.get("goal", j) for j in range(15)) in goals
    assert sim.get("state") in (3, 5)
    assert taken > count / 40  # one number in five jumps by 200: what follows is stale until the numbers have come round


def test_only_whole_and_fitting_uploads_ever_play() -> None:
    uploads(300, 1)


@pytest.mark.slow
def test_only_whole_and_fitting_uploads_ever_play_of_ten_thousand() -> None:
    for seed in range(10):
        uploads(1000, seed)


def test_state_is_told_when_it_changes_and_when_asked() -> None:
    sim = Sim(TABLE, cause=3)
    sim.run(20)
    told = [m for m in sim.messages() if isinstance(m, StateMessage)]
    assert [(m.state, m.reason) for m in told] == [(ControllerState.STILL, "watchdog: the program hung")]
    sim.send(encode_frame(FrameType.ASK))
    sim.run(5)
    assert sum(isinstance(m, StateMessage) for m in sim.messages()) == 1


def test_a_broken_built_in_table_plays_nothing() -> None:
    sim = Sim(TABLE[:-1] + b"\0")
    sim.run(1000)
    assert (sim.get("state"), sim.get("reason")) == (0, 23)
    asked = (FrameType.PLAY, FrameType.RELEASE, FrameType.BRIDGE)
    for data in (*map(encode_frame, asked), *upload_frames(TABLE, 1)):
        sim.send(data)
    sim.run(200)
    kinds = [sim.get("event_kind", k) for k in range(sim.get("events"))]
    assert 1 not in kinds
    assert 2 in kinds  # RELEASE is obeyed all the same: servos may hold from before
