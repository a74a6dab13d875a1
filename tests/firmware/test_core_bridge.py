"""The native core as a bridge between the PC and the servos."""

from __future__ import annotations

import pytest

from tests.firmware.native import Sim, until, walk
from workbench.device.link import AnswerMessage, FrameReader, FrameType, encode_frame
from workbench.device.virtual.protocol import packet

TABLE = walk()
LIMP, CHECK = 1, 2


def bridged(seed: int = 0) -> Sim:
    sim = Sim(TABLE, seed=seed)
    sim.to_neutral()
    sim.send(encode_frame(FrameType.RELEASE))
    sim.run(100)
    sim.send(encode_frame(FrameType.BRIDGE))
    sim.run(10)
    assert sim.get("state") == 8
    sim.received()
    return sim


def test_bridge_passes_packets_and_answers_and_keeps_ruinous_ones_back() -> None:
    sim = bridged()
    sim.send(packet(9, 1))
    sim.run(3)
    assert sim.received() == packet(9, 0)
    sim.send(packet(9, 2, bytes([36, 2])))
    sim.run(3)
    answer = sim.received()
    assert answer[:5] == bytes([0xFF, 0xFF, 9, 4, 0])
    sim.send(packet(9, 3, bytes([30, 88, 2, 50, 0])))
    sim.run(900)
    assert sim.get("position", 6) == 600
    assert sim.received() == packet(9, 0)
    for ruinous in (packet(254, 6), *(packet(254, i, bytes([at, 9])) for i in (3, 4) for at in (0, 3, 4))):
        sim.send(ruinous)
        sim.run(10)
        assert on_the_bus(sim) == (9, 3)  # that write is still the last that was sent
    for fine in (packet(254, 3, bytes([5, 0])), packet(9, 3, bytes([3, 9])), packet(99, 1)):
        sim.send(fine)
        sim.run(10)
        assert on_the_bus(sim) == (fine[2], fine[4])
    assert sim.received() == packet(9, 0)  # of the ID, which this robot's servos keep


def on_the_bus(sim: Sim) -> tuple[int, int]:
    """Servo and instruction of the last packet."""
    return sim.get("sent", 2), sim.get("sent", 4)


@pytest.mark.parametrize("wait", range(0, 26))
def test_the_bridge_loses_no_packet_and_passes_on_no_answer_that_was_not_asked_for(wait: int) -> None:
    """A read of the controller's own is under way when the bridge begins, or the answer to the packet before is not in."""
    sim = Sim(TABLE)
    sim.to_neutral()
    sim.send(encode_frame(FrameType.RELEASE))
    sim.run(100 + wait)
    sim.received()
    sim.send(encode_frame(FrameType.BRIDGE) + packet(9, 1))
    sim.run(8)
    said = sim.received()
    assert said.endswith(packet(9, 0))
    (answer,) = FrameReader().feed(said[said.rindex(b"\xa5\x5a"):-6])
    assert answer.type == FrameType.ANSWER
    sim.send(packet(9, 1) + packet(10, 2, bytes([3, 1])) + packet(8, 1))
    sim.run(8)
    assert sim.received() == packet(9, 0) + packet(10, 0, bytes([10])) + packet(8, 0)


def test_bridge_ends_in_a_ramp_if_something_moved_and_just_lets_go_if_not() -> None:
    sim = bridged()
    sim.send(packet(9, 3, bytes([30, 88, 2, 50, 0])))
    sim.run(600)
    sim.send(packet(9, 1))
    sim.run(1100)
    assert (sim.get("state"), sim.get("reason")) == (7, 22)
    sim.run(3000)
    assert sim.get("state") == 1
    assert abs(sim.get("position", 6) - 512) < 20
    assert not any(sim.get("torque", j) for j in range(15))
    sim = bridged()
    sim.send(packet(9, 1))
    sim.run(1100)
    assert (sim.get("state"), sim.get("reason")) == (1, 22)
    sim = bridged()
    sim.send(encode_frame(FrameType.BRIDGE_END))
    sim.run(20)
    assert sim.get("state") == 1


def test_bridge_is_refused_while_torque_is_on() -> None:
    sim = Sim(TABLE)
    sim.play()
    sim.messages()
    sim.send(encode_frame(FrameType.BRIDGE))
    sim.run(5)
    assert sim.get("state") == 5
    assert not next(m for m in sim.messages() if isinstance(m, AnswerMessage)).well


def test_the_bridge_ends_after_1000_ms() -> None:
    sim = bridged()
    sim.send(packet(9, 1))
    assert until(sim, {LIMP}) == 1000
    sim = bridged()
    sim.run(970)
    sim.send(packet(9, 1))
    sim.run(990)
    assert sim.get("state") == 8


@pytest.mark.parametrize(("sent", "moved"), [
    (packet(9, 4, bytes([30, 88, 2])), True), (packet(9, 5), True), (packet(9, 3, bytes([24, 1])), True),
    (packet(9, 3, bytes([47, 0])), False), (packet(9, 3, bytes([48, 40, 0])), False), (packet(9, 2, bytes([30, 2])), False)])
def test_what_counts_as_moving_a_servo_through_the_bridge(sent: bytes, moved: bool) -> None:
    sim = bridged()
    sim.send(sent)
    until(sim, {LIMP, CHECK})  # after silence: whoever was moved is asked where it is, and brought back
    assert sim.get("state") == (CHECK if moved else LIMP)


@pytest.mark.parametrize("sent", [packet(9, 3, bytes([27, 200])), b"\xff" + packet(9, 1)])
def test_a_large_byte_or_a_third_ff_is_no_header_through_the_bridge(sent: bytes) -> None:
    sim = bridged()
    sim.send(sent)
    sim.run(4)
    assert sim.received() == packet(9, 0)
