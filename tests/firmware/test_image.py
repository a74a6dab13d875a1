"""The image that is flashed, on the virtual CM-530: poses to the microsecond, and what goes on beside them."""

from __future__ import annotations

import struct
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
import pytest

from tests.firmware.image import IDS, Robot, image, needs_compiler
from tests.firmware.native import walk
from tests.firmware.test_core_play import changed
from workbench.device.link import (
    AnswerMessage,
    ControllerState,
    FrameType,
    LogMessage,
    StateMessage,
    encode_frame,
    upload_frames,
)
from workbench.device.tables.table_file import decode_table
from workbench.device.virtual import MICROSECOND, MILLISECOND, SECOND
from workbench.device.virtual.protocol import checksum, packet

pytestmark = needs_compiler
DWELLS = np.array([140, 103, 94, 131])


def goals_of(data: bytes) -> list[tuple[int, int]]:
    """(goal, speed) by servo, in the order of IDS, of a Sync Write whose every byte is looked at."""
    assert data[:7] == bytes([0xFF, 0xFF, 0xFE, 79, 0x83, 30, 4])
    assert len(data) == 83
    assert checksum(data[2:-1]) == data[-1]
    rows = struct.iter_unpack("<BHH", data[7:-1])
    by_id = {i: (goal, speed) for i, goal, speed in rows}
    return [by_id[i] for i in IDS]


def same(row: tuple[tuple[int, int], ...], sent: list[tuple[int, int]]) -> bool:
    """Whether a table's (goals, speeds) are what was sent; for speed 0, "at once", another is sent."""
    return all(goal == g and (s == speed or (speed == 0 < s <= 1023)) for (goal, speed), (g, s) in zip(row, sent))


def play(poses: int, seed: int = 0) -> Robot:
    """A walk of so many poses with telemetry, remote and uploads going on; every byte and every time is looked at."""
    robot = Robot(seed)
    robot.to_neutral()
    began = len(robot.ear.poses)
    robot.remote(1)
    robot.remote(0)
    tables = [changed(shift) for shift in (3, -2, 4, 0)]
    valid = {shift: [tuple(zip(g, s)) for g, s in zip(t.goals.tolist(), t.speeds.tolist())]
             for shift, t in ((k, decode_table(d).table) for k, d in enumerate([*tables, walk()]))}
    sequence, logs = 0, 0
    rng = np.random.default_rng(seed)
    while len(robot.ear.poses) - began < poses:
        robot.run(float(rng.uniform(300, 900)))
        if rng.random() < 0.3:
            sequence = (sequence + 1) % 256
            link = robot.board.pc if rng.random() < 0.5 else robot.board.zigbee
            for data in upload_frames(tables[sequence % 4], sequence):
                robot.board.send(link, data)
        elif rng.random() < 0.3:
            robot.remote(int(rng.choice([0, 2, 4, 8, 32])))
        logs += sum(isinstance(m, LogMessage) for m in robot.messages())
    sent = robot.ear.poses[began:began + poses]
    times = np.array([t for t, _ in sent])
    expected = times[0] + MILLISECOND * np.concatenate([[0], np.cumsum(np.tile(DWELLS, poses // 4 + 1))])[:poses]
    assert np.abs(times - expected).max() <= 50 * MICROSECOND
    playing = {4}  # the built-in table, until another is seen
    for k, (_, data) in enumerate(sent):
        playing = {t for t in (playing if k % 4 else set(valid)) if same(valid[t][k % 4], goals_of(data))}
        assert playing, f"pose {k}"
    elapsed = (times[-1] - times[0]) / SECOND
    assert logs >= 40 * elapsed
    assert not robot.bus.collisions
    robot.sound()
    robot.worst = float(np.abs(times - expected).max() / MICROSECOND)
    return robot


def test_five_hundred_poses_with_telemetry_remote_and_uploads() -> None:
    play(500)


def test_a_part_of_an_upload_that_ends_just_before_a_pose_does_not_delay_it() -> None:
    """Its sum takes 80 us: that has to wait until the pose is out."""
    robot = Robot()
    robot.to_neutral()
    began = len(robot.ear.poses)
    robot.remote(1)
    robot.remote(0)
    robot.run(20)
    (first,) = (t for t, _ in robot.ear.poses[began:])
    data = b"".join(upload_frames(walk(), 1)[:2])
    due = first + MILLISECOND * np.cumsum(np.tile(DWELLS, 3))
    for at, before in zip(due.tolist(), (np.linspace(0, 90, len(due)) * MICROSECOND).astype(int).tolist()):
        robot.board.send(robot.board.pc, data, at - before - len(data) * (SECOND * 10 // 57_600))
        robot.run((at - robot.clock.now) / MILLISECOND + 1)
    late = np.array([t for t, _ in robot.ear.poses[began + 1:]]) - due
    assert np.abs(late).max() < 15 * MICROSECOND
    robot.sound()


def long_walk(seed: int) -> tuple[str, float, float]:
    """Ten thousand poses: the trace's hash, the worst start of a packet [us], and processor time [s]."""
    began = time.process_time()
    robot = play(10_000, seed)
    return robot.ear.digest.hexdigest(), robot.worst, time.process_time() - began


@pytest.mark.slow
def test_ten_thousand_poses_and_once_more_the_same() -> None:
    image()
    with ProcessPoolExecutor(2) as pool:
        (first, worst, processor), (second, _, _) = pool.map(long_walk, (11, 11))
    print(f"10,000 poses: {processor:.0f} s of processor; worst first bit {worst:.1f} us; trace {first[:16]}")
    assert first == second
    assert processor < 600


def test_the_same_seed_gives_the_same_trace() -> None:
    assert len({play(30, seed=7).ear.digest.hexdigest() for _ in range(2)}) == 1


def test_direction_follows_the_bytes() -> None:
    robot = Robot()
    robot.run(300)
    talk = [(t, out) for t, out, into in robot.board.directions if out != into]
    starts = [t for t, p in robot.ear.packets]
    on = [t for t, out in talk if out]
    off = [t for (t, out), (_, before) in zip(talk[1:], talk) if before and not out]
    ends = [t + 720 * len(p) for t, p in robot.ear.packets]
    assert len(on) >= len(starts) > 100
    assert max(s - t for s, t in zip(starts, on)) < 5 * MICROSECOND
    assert min(t - e for t, e in zip(off, ends)) >= 0
    assert max(t - e for t, e in zip(off, ends)) < 5 * MICROSECOND  # a servo answers after 18 us at the earliest
    robot.sound()


def test_power_on_ramps_slowly_from_where_the_joints_are() -> None:
    robot = Robot(3)
    start = {i: robot.body.sense(i, 0).angle for i in IDS}
    assert max(abs(a) for a in start.values()) > 0.09
    robot.to_neutral()
    first = robot.ear.poses[0]
    assert all(goal == 512 and 0 < speed <= 45 for goal, speed in goals_of(first[1]))
    assert all(s["torque_enable"] == 1 for s in robot.servos.values())
    robot.sound()


@pytest.mark.parametrize(("before", "lost"), [(b"\0", 0), (b"\xff\x3c\xff", 0), (b"", 1)])
def test_stray_and_missing_bytes_where_the_bus_turns_round_and_servos_that_start_late(before: bytes, lost: int) -> None:
    """The receiver's DMA takes what has come in front of an answer for a part of it, and goes on for as many bytes."""
    robot = Robot()
    talk, byte = robot.bus.talk, 10 * MICROSECOND

    def turned_round(talker, values, rate, starts):
        if talker in robot.bus.servos:
            first = starts[0] - byte * len(before)
            values, starts = before + values[lost:], [*range(first, starts[0], byte), *starts[lost:]]
        return talk(talker, values, rate, starts)

    robot.bus.talk = turned_round  # type: ignore[method-assign]
    for servo in robot.servos.values():
        servo.power(False)
        robot.clock.after(200 * MILLISECOND, partial(servo.power, True))
    robot.to_neutral()
    robot.run(100)
    logs = [m for m in robot.messages() if isinstance(m, LogMessage)]
    assert all(None not in m.positions for m in logs)
    assert len(logs) >= (1 if lost else 3)  # a lost byte costs each answer its time-out
    assert all(s["torque_enable"] == 1 for s in robot.servos.values())
    robot.sound()


def test_a_missing_servo_keeps_torque_off() -> None:
    robot = Robot()
    robot.servos[9].power(False)
    robot.run(2300)
    states = [m for m in robot.messages() if isinstance(m, StateMessage)]
    assert (states[-1].state, states[-1].reason, states[-1].servo) == (ControllerState.LIMP, "a servo is silent", 9)
    assert not robot.ear.poses
    robot.sound()


def reset_by(robot: Robot, how: str) -> str:
    if how == "hang":
        robot.board.core.words[0x10] = 0  # SysTick dies: the main loop feeds no more
        robot.board.core._generation += 1
        return "watchdog: the program hung"
    if how == "brown-out":
        for servo in robot.servos.values():
            servo.power(False)
            servo.power(True)
        robot.board.reset(1 << 27 | 1 << 26)
        return "brown-out"
    if how == "fault":
        robot.board.cpu.uc.mem_write(0x08003000 + 4 * 15, struct.pack("<I", 0x40000001))  # the SysTick vector is broken
        return "watchdog: the program hung"
    robot.board.reset(1 << 26)
    return "reset button"


@pytest.mark.parametrize("how", ["hang", "brown-out", "reset button", "fault"])
def test_after_any_reset_it_stands_still_and_says_why(how: str) -> None:
    robot = Robot()
    robot.play()
    robot.run(777)
    robot.messages()
    reason = reset_by(robot, how)
    at = robot.clock.now
    if how == "fault":
        robot.run(60)
        robot.board.cpu.uc.mem_write(0x08003000, image()[:256])
    robot.run(340)
    states = [m for m in robot.messages() if isinstance(m, StateMessage)]
    assert [(m.state, m.reason) for m in states] == [(ControllerState.STILL, reason)]
    assert all(t < at + 140 * MILLISECOND for t, p in robot.ear.packets if p[4] == 0x83)
    robot.run(400)
    assert not [1 for t, p in robot.ear.packets if p[4] in (3, 0x83) and t > at + 250 * MILLISECOND]
    robot.board.press_start(True)
    robot.run(100)
    robot.board.press_start(False)
    robot.run(3500)
    assert any(m.state == ControllerState.NEUTRAL for m in robot.messages() if isinstance(m, StateMessage))


def test_flips_in_both_directions_stop_nothing_and_every_goal_is_put_right() -> None:
    flips(8)


def test_a_length_that_is_spoilt_on_the_way_silences_no_servo_for_long() -> None:
    """Servos read the next 128 bytes as the rest of a packet: as many as 17 questions have, with no pose among them, after which
    the controller would conclude that the supply is dead."""
    robot, heard = Robot(), bytearray(3)
    robot.play()

    def line(value: int) -> int:
        spoilt = len(heard) < 4 and heard[-3:-1] == b"\xff\xff" and heard[-1] < 0xFE and value == 4
        heard[:] = bytes(4) if spoilt or len(heard) == 4 else heard[1:] + bytes([value])
        return value ^ 0x80 if spoilt else value

    robot.bus.to_servos = line
    robot.run(400)
    assert not [m for m in robot.messages() if isinstance(m, StateMessage) and m.state == ControllerState.LIMP]
    assert [len(data) for _, data in robot.ear.packets if not any(data)] == [128]


@pytest.mark.slow
def test_flips_for_ten_minutes() -> None:
    flips(600)


def flips(seconds: int) -> None:
    robot = Robot(5, to_servos=0.001, from_servos=0.001)
    robot.to_neutral()
    while not any(getattr(m, "state", None) == 5 for m in robot.messages()):  # a word of the remote may be lost as well
        robot.remote(1)
        robot.remote(0)
        robot.run(100)
    wrong: dict[int, int] = {}
    for _ in range(seconds * 200):
        robot.run(5)
        meant = goals_of(robot.ear.poses[-1][1])
        for i, (goal, speed) in zip(IDS, meant):
            servo = robot.servos[i]
            assert servo["cw_angle_limit"] <= servo["goal_position"] <= servo["ccw_angle_limit"]
            right = (servo["goal_position"], servo["moving_speed"]) == (goal, speed)
            since = wrong.setdefault(i, robot.clock.now) if not right else wrong.pop(i, 0) and 0
            assert not since or robot.clock.now - since <= 55 * MILLISECOND
        del robot.ear.packets[:-200]
    assert not [m for m in robot.messages() if isinstance(m, StateMessage) and m.state != ControllerState.PLAY]
    robot.sound()


def test_bridge_on_the_wire_and_its_end() -> None:
    robot = Robot()
    robot.to_neutral()
    robot.board.send(robot.board.pc, encode_frame(FrameType.RELEASE))
    robot.run(100)
    robot.board.send(robot.board.pc, encode_frame(FrameType.BRIDGE))
    robot.run(30)
    assert any(isinstance(m, AnswerMessage) and m.well for m in robot.messages())
    before = len(robot.board.pc.received)
    robot.board.send(robot.board.pc, packet(9, 2, bytes([36, 2])))
    robot.run(8)
    assert bytes(robot.board.pc.received[before:]) == packet(9, 0, bytes([0, 2]))
    robot.board.send(robot.board.pc, packet(9, 3, bytes([30, 88, 2, 50, 0])))
    robot.run(900)
    assert robot.servos[9]["torque_enable"] == 1
    robot.run(4000)
    assert not any(s["torque_enable"] for s in robot.servos.values())
    robot.sound()
