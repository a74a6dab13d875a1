"""The native core exactly at its thresholds, and at its largest sizes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from tests.firmware.native import LINK_PC, Sim, until, walk
from tests.firmware.test_core_play import goal_times
from workbench.device.link import AnswerMessage, FrameType, LogMessage, StateMessage, encode_frame
from workbench.device.tables.table_file import JointBounds, TableFile, decode_table, encode_table
from workbench.motion import PoseTable

TABLE = walk()
LIMP, CHECK, RAMP, NEUTRAL, PLAY = 1, 2, 3, 4, 5


@pytest.mark.parametrize(("held", "state"), [(19, NEUTRAL), (20, PLAY)])
def test_a_button_counts_from_20_ms_on(held: int, state: int) -> None:
    sim = Sim(TABLE)
    sim.to_neutral()
    sim.set("start", 1)
    sim.run(held)
    sim.set("start", 0)
    sim.run(2)
    assert sim.get("state") == state


@pytest.mark.parametrize(("up", "state"), [(19, NEUTRAL), (20, PLAY)])
def test_a_button_that_was_down_is_believed_once_it_was_up_for_20_ms(up: int, state: int) -> None:
    sim = Sim(TABLE)
    sim.set("start", 1)
    sim.to_neutral()
    sim.set("start", 0)
    sim.run(up)
    sim.run(1)
    sim.set("start", 1)
    sim.run(100)
    sim.set("start", 0)
    sim.run(5)
    assert sim.get("state") == state


def test_start_held_releases_after_1500_ms_and_once() -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.set("start", 1)
    assert until(sim, {LIMP}) == 1501
    sim.set("start", 0)
    sim.run(300)
    assert sim.get("state") == LIMP


def reason_with(what: str, value: int, ms: int = 1900) -> int:
    sim = Sim(TABLE)
    sim.play()
    sim.run(400)
    for k in range(15 if what == "volts" else 1):
        sim.set(what, value, k)
    sim.run(ms)
    return sim.get("reason")


@pytest.mark.parametrize(("what", "value", "reason"), [
    ("heat", 64, 7), ("heat", 65, 14), ("volts", 96, 7), ("volts", 95, 15), ("volts", 65, 15), ("volts", 64, 16)])
def test_heat_and_voltage_at_their_thresholds(what: str, value: int, reason: int) -> None:
    assert reason_with(what, value) == reason


def test_a_dead_supply_that_still_answers_is_told_by_its_voltage_in_three_rounds() -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.run(400)
    sim.set("volts", 60)
    assert 2 * 24 <= until(sim, {LIMP}) <= 4 * 24 + 5


@pytest.mark.parametrize(("hangs", "raised"), [(0, 0), (3, 3), (14, 14), (20, 14)])
def test_a_joint_that_hangs_is_brought_to_neutral_itself_and_let_down_from_there(hangs: int, raised: int) -> None:
    sim = Sim(TABLE)
    sim.run(100)
    sim.set("hangs", hangs, 4)
    goals = []
    while sim.get("state") != NEUTRAL:
        sim.run(5)
        goals.append(sim.get("goal", 4))
        assert len(goals) < 1000
    assert max(goals[-140:]) == 512 + raised
    assert goals[-1] == 512
    assert goals[-140:].count(512 + raised) >= 60


def test_a_servo_without_torque_limit_is_overloaded_even_without_the_alarm_bit() -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.set("torque_limit", 0, 3)
    sim.run(200)
    assert (sim.get("reason"), sim.get("servo_named")) == (13, sim.get("id", 3))


@pytest.mark.parametrize(("side", "by", "state"), [("cw", 2, NEUTRAL), ("cw", 3, LIMP), ("ccw", 2, NEUTRAL), ("ccw", 3, LIMP)])
def test_angle_limits_may_be_narrower_by_the_rounding_of_degrees(side: str, by: int, state: int) -> None:
    bounds = decode_table(TABLE).joints[4]
    sim = Sim(TABLE)
    sim.set(f"{side}_limit", bounds.low + by if side == "cw" else bounds.high - by, 4)
    sim.run(1500)
    assert sim.get("state") == state
    assert sim.get("reason") == (20 if state == LIMP else 1)


@pytest.mark.parametrize(("moved", "fine"), [(6, True), (60, False)])
def test_no_torque_while_a_joint_moves(moved: int, fine: bool) -> None:
    sim = Sim(TABLE)
    for k in range(40):
        sim.set("position", 512 + moved * (k % 2), 7)
        sim.run(19)
        if sim.get("state") != 2:
            break
    assert (sim.get("state") != LIMP) == fine
    assert sim.get("reason") == (1 if fine else 24)


def walk_of(n: int, dwell: int) -> bytes:
    """Two poses of a robot of n joints."""
    goals = np.array([[500 + k for k in range(n)], [520 - k for k in range(n)]])
    table = PoseTable(tuple(f"j{k}" for k in range(n)), goals, np.full((2, n), 100), np.array([dwell, dwell]))
    return encode_table(TableFile(table, tuple(JointBounds(k + 1, low=400, high=600) for k in range(n))))


def test_there_is_no_pause_before_every_servo_has_been_asked_for_its_new_goal() -> None:
    """Eight joints are read in 11 ms, every 24 ms; where a pose falls into a round, the next begins at once."""
    sim = Sim(walk_of(8, 103))
    sim.play()
    logs: list[LogMessage] = []
    for _ in range(200):
        sim.run(50)
        logs += [m for m in sim.messages() if isinstance(m, LogMessage)]
    poses = np.array(goal_times(sim)) * 1e-6
    pauses = [after.time - log.time - log.duration for log, after in pairwise(logs)
              if np.any((poses > log.time + 0.003) & (poses < log.time + log.duration - 0.003))]
    assert len(pauses) > 10
    assert max(pauses) <= 0.002


def test_twenty_six_joints_walk_and_tell() -> None:
    n = 26
    sim = Sim(walk_of(n, 150))
    sim.play()
    sim.run(500)
    sim.received()
    sim.run(60)
    logs = [m for m in sim.messages() if isinstance(m, LogMessage)]
    assert logs
    assert all(len(m.positions) == n and None not in m.positions for m in logs)
    assert sim.get("state") == PLAY


def test_what_finds_no_room_on_the_link_is_told_later() -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.run(500)
    for _ in range(30):
        sim.send(encode_frame(FrameType.ASK))  # nobody reads: the link's buffer is full
    sim.run(50)
    sim.remote(16)
    sim.remote(0)
    sim.run(100)
    assert sim.get("state") == 6
    sim.received(LINK_PC)
    sim.run(3)
    assert next(m.state for m in sim.messages() if isinstance(m, StateMessage)) == 6


def test_torque_off_is_told_again_to_a_servo_that_missed_it_but_not_all_the_time() -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.send(encode_frame(FrameType.RELEASE))
    sim.run(50)
    for k in range(15):
        assert sim.get("torque", k) == 0
    sim.set("torque", 1, 5)
    sim.run(120)
    assert sim.get("torque", 5) == 0
    offs = [sim.get("event_us", k) for k in range(sim.get("events")) if sim.get("event_kind", k) == 2]
    assert 4 <= len(offs) <= 20
    assert all(after - before < 1000 for before, after in zip(offs[::2], offs[1::2]))  # twice in a row, then a while not
    assert min(np.diff(offs[::2])) >= 5000


@pytest.mark.parametrize(("stray", "windows", "reason"), [(39, 6, 7), (40, 3, 7), (40, 4, 17)])
def test_babble_is_40_bytes_in_each_of_four_windows_of_25_ms(stray: int, windows: int, reason: int) -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.run(25 - sim.get("us") // 1000 % 25 + 12)
    for _ in range(windows):
        sim.set("stray", sim.get("stray") + stray)
        sim.run(25)
    sim.run(50)
    assert sim.get("reason") == reason


@pytest.mark.parametrize(("few", "reason"), [(7, 7), (8, 15)])
def test_the_battery_is_low_where_more_than_half_of_the_servos_say_so(few: int, reason: int) -> None:
    sim = Sim(TABLE)
    sim.play()
    for k in range(few):
        sim.set("drop", 20, k)
    sim.run(1900)
    assert sim.get("reason") == reason
    sim = Sim(TABLE)
    for k in range(few):
        sim.set("drop", 20, k)
    sim.run(300)
    assert (sim.get("state") == LIMP) == (reason == 15)


def test_what_comes_on_a_link_waits_while_a_pose_is_a_millisecond_away_and_no_longer() -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.messages()
    ask, before_poses, waits = encode_frame(FrameType.ASK), 0, 0
    for _ in range(400):
        sim.send(ask[:3])  # less than a millisecond's, which would go by
        sim.send(ask[3:])
        sim.run(1)
        at_once = any(isinstance(m, AnswerMessage) for m in sim.messages())
        poses = sim.get("poses")
        sim.run(1)
        later = any(isinstance(m, AnswerMessage) for m in sim.messages())
        assert at_once + later == 1
        if sim.get("poses") > poses:
            assert later
            before_poses += 1
        waits += later
    assert before_poses > 2
    assert waits < 200


def test_the_log_tells_each_joints_slow_values_as_its_registers_hold_them() -> None:
    sim = Sim(TABLE)
    sim.to_neutral()
    for j in range(15):
        for what, value in (("turning", 300 + j), ("load", 600 + j), ("drop", j % 3), ("heat", 30 + j)):
            sim.set(what, value, j)
    volts = sim.get("volts")
    sim.run(50)
    sim.messages()
    sim.run(200)
    slow = {s.joint: s for m in sim.messages() if isinstance(m, LogMessage) for s in m.slow}
    assert slow.keys() == set(range(15))
    for j, s in slow.items():
        assert (s.speed, s.load, s.voltage, s.temperature) == (300 + j, 600 + j, (volts - j % 3) / 10, 30 + j)


def test_the_log_tells_how_many_poses_of_the_cycle_went_out() -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.run(20)
    sim.messages()  # of before the first pose
    poses = []
    for _ in range(75):
        sim.run(20)
        poses += [m.pose for m in sim.messages() if isinstance(m, LogMessage)]
    assert set(poses) == {1, 2, 3, 4}
    assert all(after == before or after == before % 4 + 1 for before, after in pairwise(poses))


def test_a_stop_in_the_ramp_of_power_on_changes_nothing() -> None:
    sim = Sim(TABLE)
    until(sim, {RAMP})
    sim.send(encode_frame(FrameType.STOP))
    states = set()
    for _ in range(4000):
        sim.run(1)
        states.add(sim.get("state"))
        if NEUTRAL in states:
            break
    assert states == {RAMP, NEUTRAL}


def test_a_button_that_hangs_does_not_start_what_was_stopped_otherwise() -> None:
    sim = Sim(TABLE)
    sim.play()
    for k in range(60):
        sim.remote(1)
        sim.run(60)
        if k == 5:
            sim.send(encode_frame(FrameType.STOP))
    assert sim.get("state") == NEUTRAL
    sim.remote(0)
    sim.remote(1)
    sim.remote(0)
    sim.run(5)
    assert sim.get("state") == PLAY
