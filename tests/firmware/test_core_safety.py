"""The native core where a partner is rude: who may give torque back, what releases, first poses, servos that start late."""

from __future__ import annotations

import numpy as np
import pytest

from tests.firmware.native import Sim, until, walk
from tests.firmware.test_core_play import changed
from workbench.device.link import REASONS, FrameType, encode_frame
from workbench.device.tables.table_file import TableFile, decode_table, encode_table
from workbench.motion import PoseTable

TABLE = walk()
STILL, LIMP, CHECK, RAMP, NEUTRAL, PLAY, STOP = range(7)
WATCHDOG, BROWN_OUT = 3, 5


def torque(sim: Sim) -> int:
    return sum(sim.get("torque", j) for j in range(15))


def hold_start(sim: Sim, ms: int = 1600) -> None:
    sim.set("start", 1)
    sim.run(ms)
    sim.set("start", 0)
    sim.run(30)


def after_reset_in_walk(cause: int) -> Sim:
    """A controller that was reset in the middle of a walk; its servos hold the pose with full torque."""
    sim = Sim(TABLE)
    sim.play()
    sim.run(700)
    sim.lib.sim_reset(sim.p, TABLE, len(TABLE), cause)
    sim.run(100)
    assert (sim.get("state"), torque(sim)) == (STILL, 15)
    return sim


@pytest.mark.parametrize("cause", ["release", "held", "dead supply", "babble"])
def test_no_frame_but_play_gives_torque_back_after_a_release(cause: str) -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.run(300)
    if cause == "release":
        sim.send(encode_frame(FrameType.RELEASE))
    elif cause == "held":
        hold_start(sim)
    elif cause == "dead supply":
        sim.set("volts", 60)
    else:
        sim.set("babble", 1)
    until(sim, {LIMP})
    sim.set("volts", 111)
    sim.set("babble", 0)
    sim.run(100)
    for kind in range(256):
        if kind not in (FrameType.PLAY, FrameType.BRIDGE):
            sim.send(encode_frame(kind))
            sim.run(20)
            sim.received()
            assert (sim.get("state"), torque(sim)) == (LIMP, 0), kind
    sim.send(encode_frame(FrameType.PLAY))
    sim.to_neutral()
    assert torque(sim) == 15


@pytest.mark.parametrize("cause", [WATCHDOG, BROWN_OUT])
def test_a_stop_frame_starts_nothing_after_a_reset(cause: int) -> None:
    sim = after_reset_in_walk(cause)
    sim.send(encode_frame(FrameType.STOP))
    sim.run(500)
    assert sim.get("state") == STILL


@pytest.mark.parametrize(("cause", "state"), [(WATCHDOG, STILL), (0, LIMP)])
def test_a_stop_in_the_check_gives_it_up(cause: int, state: int) -> None:
    sim = after_reset_in_walk(cause) if cause else Sim(TABLE)
    if not cause:
        sim.to_neutral()
        sim.send(encode_frame(FrameType.RELEASE))
        sim.run(100)
    sim.send(encode_frame(FrameType.PLAY))
    until(sim, {CHECK})
    sim.send(encode_frame(FrameType.STOP))
    sim.run(3000)
    assert sim.get("state") == state


def test_start_held_releases_from_every_state() -> None:
    for name in ("still", "limp", "check", "ramp", "neutral", "play", "stop", "yield", "bridge"):
        sim = after_reset_in_walk(WATCHDOG) if name == "still" else Sim(TABLE)
        if name == "check":
            sim.set("boots_until", 100_000, 3)
            sim.run(30)
        elif name == "ramp":
            for j in range(15):
                sim.set("position", 300, j)
        elif name in ("play", "stop", "yield"):
            sim.play()
            sim.run(400)
        elif name not in ("still",):
            sim.to_neutral()
        if name in ("limp", "bridge"):
            sim.send(encode_frame(FrameType.RELEASE))
            sim.run(60)
        if name == "bridge":
            sim.send(encode_frame(FrameType.BRIDGE))
        if name == "stop":
            for j in range(15):
                sim.set("held", 1, j)
            sim.send(encode_frame(FrameType.STOP))
        if name == "yield":
            sim.set("mute", 1, 2)
            until(sim, {7})
        if name == "ramp":
            until(sim, {RAMP})
        hold_start(sim)
        sim.run(100)
        assert (sim.get("state"), torque(sim)) == (LIMP, 0), name


def test_the_remote_releases_from_every_state_too() -> None:
    for sim in (after_reset_in_walk(BROWN_OUT), Sim(TABLE)):
        sim.run(600)
        sim.remote(512)
        sim.remote(0)
        sim.run(100)
        assert (sim.get("state"), torque(sim)) == (LIMP, 0)


@pytest.mark.parametrize(("what", "value", "count", "reason", "ms"), [
    ("heat", 68, 1, "a servo is hot", 400), ("overload", 1, 1, "a servo is overloaded", 400),
    ("mute", 1, 1, "a servo is silent", 400),
    ("drop", 25, 15, "the battery is low", 2000), ("drop", 60, 15, "the servos' supply is dead", 400)])
def test_what_is_wrong_is_seen_in_still_and_lets_go_there(what: str, value: int, count: int, reason: str, ms: int) -> None:
    sim = after_reset_in_walk(WATCHDOG)
    sim.run(2000)  # servos may have been restarted with the controller
    assert torque(sim) == 15
    for j in range(4, 4 + count):
        sim.set(what, value, j % 15)
    sim.run(ms)
    assert (sim.get("state"), REASONS[sim.get("reason")]) == (LIMP, reason)
    sim.set("mute", 0, 4)
    sim.run(100)
    assert torque(sim) == 0


@pytest.mark.parametrize("where", [STILL, NEUTRAL])
def test_torque_goes_after_five_minutes_of_nothing(where: int) -> None:
    sim = after_reset_in_walk(WATCHDOG) if where == STILL else Sim(TABLE)
    if where == NEUTRAL:
        sim.to_neutral()
    for _ in range(598):
        sim.run(500)
        sim.received()
    assert torque(sim) == 15
    for _ in range(6):
        sim.run(500)
    assert (sim.get("state"), REASONS[sim.get("reason")], torque(sim)) == (LIMP, "nobody used it for five minutes", 0)


@pytest.mark.parametrize("boot", [15, 100, 300, 1500])
def test_servos_that_start_late_are_waited_for(boot: int) -> None:
    sim = Sim(TABLE)
    for j in range(15):
        sim.set("boots_until", boot + j, j)
    sim.to_neutral()
    assert torque(sim) == 15


def test_a_servo_that_never_starts_is_told_after_two_seconds() -> None:
    sim = Sim(TABLE)
    sim.set("boots_until", 10**6, 6)
    assert 1990 <= until(sim, {LIMP}) <= 2100
    assert (REASONS[sim.get("reason")], sim.get("servo_named")) == ("a servo is silent", sim.get("id", 6))
    sim.set("boots_until", 0, 6)
    sim.send(encode_frame(FrameType.PLAY))
    sim.to_neutral()


@pytest.mark.parametrize(("what", "many"), [("lead", 1), ("lead", 2), ("lead", 7), ("lacks", 1)])
def test_bytes_too_many_or_too_few_where_the_line_turns_round_change_nothing(what: str, many: int) -> None:
    sim = Sim(TABLE)
    for j in range(15):
        sim.set(what, many, j)
    sim.play()
    for _ in range(100):
        sim.run(50)
        sim.received()
    assert sim.get("state") == PLAY


def snap(far: int) -> bytes:
    """The walk with a joint that stays at `far` in all poses: its moving speed is 0 in each."""
    file = decode_table(TABLE)
    t = file.table
    goals, speeds = t.goals.copy(), t.speeds.copy()
    goals[:, 7] = far
    speeds[:, 7] = 0
    return encode_table(TableFile(PoseTable(t.joints, goals, speeds, t.dwells_ms), file.joints))


@pytest.mark.parametrize(("far", "ramps"), [(717, True), (525, False)])
def test_no_joint_is_sent_to_the_first_pose_at_once(far: int, ramps: bool) -> None:
    sim = Sim(snap(far))
    sim.to_neutral()
    sim.send(encode_frame(FrameType.PLAY))
    states = set()
    for _ in range(4000):
        sim.run(1)
        states.add(sim.get("state"))
        assert sim.get("speed", 7) > 0
        sim.received()
    assert (RAMP in states, PLAY in states) == (ramps, True)
    assert sim.get("position", 7) in range(far - 2, far + 3)


def test_speed_nought_never_goes_out_and_without_a_way_the_last_speed_stays() -> None:
    sim = Sim(TABLE)
    sim.play()
    seen = set()
    for _ in range(1000):
        sim.run(1)
        seen |= {(j, sim.get("speed", j)) for j in range(15)}
        sim.received()
    assert all(speed for _, speed in seen)
    assert (12, 45) in seen  # the head, that never moves
    speeds = decode_table(TABLE).table.speeds
    assert {(int(j), int(speeds[k, j])) for k, j in np.argwhere(speeds > 0)} <= seen


def test_the_first_way_to_neutral_has_half_the_torque_and_then_all_of_it() -> None:
    sim = Sim(TABLE)
    for j in range(15):
        sim.set("position", 300 + j, j)
    until(sim, {RAMP})
    while sim.get("state") == RAMP:
        assert [sim.get("torque_limit", j) for j in range(15)] == [512] * 15
        sim.run(5)
    sim.run(100)
    assert (sim.get("state"), [sim.get("torque_limit", j) for j in range(15)]) == (NEUTRAL, [1023] * 15)


def test_the_torque_limit_is_put_back_after_a_release_and_after_a_broken_packet() -> None:
    sim = Sim(TABLE)
    for j in range(15):
        sim.set("position", 300, j)
    until(sim, {RAMP})
    sim.run(100)
    sim.send(encode_frame(FrameType.RELEASE))
    sim.run(150)
    assert [sim.get("torque_limit", j) for j in range(15)] == [1023] * 15
    sim.send(encode_frame(FrameType.PLAY))
    sim.to_neutral()
    sim.set("torque_limit", 1, 4)
    sim.run(100)
    assert sim.get("torque_limit", 4) == 1023


def test_a_lowered_limit_that_a_servo_misses_keeps_torque_off() -> None:
    sim = Sim(TABLE, seed=2)
    sim.set("flip_to", 20_000)
    for _ in range(400):
        sim.run(1)
        if sim.get("state") == RAMP:
            assert all(sim.get("torque_limit", j) == 512 for j in range(15))
            return
    assert sim.get("state") in (CHECK, LIMP)


def test_a_changed_table_in_the_walk_still_plays() -> None:
    sim = Sim(changed(3))
    sim.play()
    sim.run(500)
    assert sim.get("state") == PLAY
