"""The table of reactions in docs/robot.md once more, each row on the wires of the flashed image."""

from __future__ import annotations

import traceback
import zlib
from collections.abc import Callable
from multiprocessing import get_context

import numpy as np
import pytest

from tests.firmware.image import IDS, Robot, needs_compiler
from tests.firmware.native import walk
from tests.firmware.test_core_reactions import CELLS, Cell
from tests.firmware.test_image import goals_of, reset_by
from workbench.device.link import REASONS, ControllerState, FrameType, StateMessage, encode_frame, upload_frames
from workbench.device.virtual import AX12A, MICROSECOND, MILLISECOND, SECOND, VirtualServo, bit_flips
from workbench.device.virtual.protocol import packet

pytestmark = needs_compiler
Rng = np.random.Generator
WATCHED = 1200
"""How long a robot that continues is watched [ms]: beyond two cycles, and every time-out but that of an upload."""


def silent(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    servo.mute = True


def twin(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    VirtualServo(robot.bus, AX12A, servo.ident, robot.body, seed=99).temperature = servo.temperature + 1


def model(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    servo["model_number"] = 29


def overload(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    servo.overload = True


def heat(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    servo.temperature = 66.0


def low(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    robot.bus.supply = 9.2


def dead(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    for each in robot.servos.values():
        each.power(False)


def checksum(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    robot.bus.from_servos = bit_flips(0.001, int(rng.integers(1 << 30)))


def babble(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    at = robot.clock.now
    for k in range(700):
        robot.clock.at(at + k * 330 * MICROSECOND,
                       lambda: robot.bus.talk("babbler", rng.bytes(32), 1_000_000, robot.clock.now))


def cut(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    first, *_, last = upload_frames(walk(), 1)
    for data in (first, last):
        robot.board.send(robot.board.pc, data)


def foreign(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    table = bytearray(walk())
    table[16] ^= 0x40  # another bus ID
    table[-4:] = zlib.crc32(table[:-4]).to_bytes(4, "little")
    for data in upload_frames(bytes(table), 1):
        robot.board.send(robot.board.pc, data)


def stalled(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    robot.board.send(robot.board.pc, upload_frames(walk(), 1)[0])


def radio(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    robot.board.send(robot.board.zigbee, b"\xff\x55\x10")  # within the word that would stop


def held(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    robot.board.press_start(True)


def remote(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    for _ in range(20):
        robot.remote(1)
        robot.run(40)


def pc(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    robot.board.send(robot.board.pc, b"\xa5\x5a\x10")


def odd(robot: Robot, servo: VirtualServo, rng: Rng) -> None:
    """For less than a round each: hot, low, mute."""
    servo.temperature = 68.0
    robot.run(20)
    servo.temperature, robot.bus.supply = 30.0, 6.2
    robot.run(20)
    robot.bus.supply, servo.mute = 11.1, True
    robot.run(20)
    servo.mute = False


FAULTS: dict[str, Callable[[Robot, VirtualServo, Rng], None]] = {
    "silent servo": silent, "two servos with one ID": twin, "wrong model": model, "overload": overload, "heat": heat,
    "low battery": low, "dead supply": dead, "bad checksum": checksum, "babbling servo": babble, "cut upload": cut,
    "foreign upload": foreign, "upload that stops": stalled, "lost radio": radio, "START held": held,
    "remote button held": remote, "PC link lost on a walk": pc, "single odd readings": odd,
}


def told_since(robot: Robot, at: int) -> list[StateMessage]:
    return [m for m in robot.messages() if isinstance(m, StateMessage) and m.time > at / SECOND]


def at_a_moment(seed: int) -> tuple[Robot, Rng]:
    """A robot at a random moment of its walk."""
    rng, robot = np.random.default_rng(seed), Robot(seed)
    robot.play()
    robot.run(float(rng.uniform(50, 1500)))
    robot.messages()
    return robot, rng


def meet(name: str, robot: Robot, rng: Rng) -> None:
    """One row, from now on."""
    row, at, servo = CELLS[name], robot.clock.now, robot.servos[int(rng.choice(IDS))]
    FAULTS[name](robot, servo, rng)
    robot.run(WATCHED if row.reaction == "continue" else row.ms + 5)
    told = told_since(robot, at)
    if row.reaction == "continue":
        assert all(m.state == ControllerState.PLAY for m in told)
        assert sum(t > at for t, _ in robot.ear.poses) >= WATCHED // 140
    else:
        reacted(robot, row, at, told, servo)
    robot.sound()


def meet_reset(how: str, robot: Robot) -> None:
    """A reset, from now on."""
    reason = reset_by(robot, how)
    robot.run(400)
    assert [(m.state, m.reason) for m in robot.messages() if isinstance(m, StateMessage)] == [(ControllerState.STILL, reason)]


def apart(work: Callable[[], None]) -> str:
    """Runs an action on the robot in a copy of this process, so that this robot is unchanged; returns the traceback, if any."""
    fork = get_context("fork")
    said = fork.SimpleQueue()

    def child() -> None:
        try:
            work()
            said.put("")
        except BaseException:
            said.put(traceback.format_exc())

    process = fork.Process(target=child)
    process.start()
    process.join()
    return "ended without a word" if said.empty() else said.get()


def reacted(robot: Robot, row: Cell, at: int, told: list[StateMessage], servo: VirtualServo) -> None:
    """The right reason was told, and the right packet came in time."""
    assert [m.reason for m in told[:1]] == [REASONS[row.reason]]
    assert not row.names or told[0].servo == servo.ident
    ramps = [t for t, p in robot.ear.packets if t > at and p[4] == 0x83 and {g for g, _ in goals_of(p)} == {512}]
    offs = [t for t, p in robot.ear.packets if t > at and p[4] == 3 and p[5:7] == b"\x18\0"]
    first = (ramps if row.reaction == "ramp" else offs)[0]
    assert first <= at + row.ms * MILLISECOND


@pytest.mark.parametrize(("name", "seed"), [("silent servo", 1), ("heat", 1), ("babbling servo", 1),
                                            ("two servos with one ID", 6)])
def test_a_fault_on_the_wire_is_met_as_in_the_core(name: str, seed: int) -> None:
    meet(name, *at_a_moment(seed))


def test_what_fails_apart_is_told_and_changes_nothing_here() -> None:
    at = [0]

    def work() -> None:
        at[0] = 1
        raise AssertionError("the ramp was late")

    assert "the ramp was late" in apart(work)
    assert apart(lambda: None) == ""
    assert at == [0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_every_fault_and_reset_at_one_random_moment(seed: int) -> None:
    robot, rng = at_a_moment(seed)
    done = {name: apart(lambda name=name: meet(name, robot, rng)) for name in FAULTS}  # type: ignore[misc]
    done |= {how: apart(lambda how=how: meet_reset(how, robot)) for how in ("brown-out", "hang")}  # type: ignore[misc]
    assert not {name: why for name, why in done.items() if why}


@pytest.mark.slow
def test_silence_of_the_pc_in_bridge_mode_at_twenty_moments() -> None:
    row = CELLS["PC link gone in bridge mode"]
    for seed in range(20):
        robot = Robot(seed)
        robot.to_neutral()
        for data in (encode_frame(FrameType.RELEASE), encode_frame(FrameType.BRIDGE)):
            robot.board.send(robot.board.pc, data)
            robot.run(100)
        goals = b"".join(bytes([i]) + (520).to_bytes(2, "little") + (50).to_bytes(2, "little") for i in IDS)
        robot.run(float(np.random.default_rng(seed).uniform(0, 100)))
        at = robot.board.send(robot.board.pc, packet(254, 0x83, b"\x1e\x04" + goals))
        robot.run((at - robot.clock.now) / MILLISECOND + row.ms + 5)
        told = told_since(robot, at)
        assert any(m.state == ControllerState.YIELD and m.reason == REASONS[row.reason] for m in told)
        ramps = [t for t, p in robot.ear.packets if t > at + MILLISECOND and p[4] == 0x83]
        assert {g for g, _ in goals_of(robot.ear.poses[-1][1])} == {512}
        assert ramps[0] <= at + row.ms * MILLISECOND
        robot.sound()


def test_every_row_is_here() -> None:
    assert CELLS.keys() == FAULTS.keys() | {"brown-out", "hang", "PC link gone in bridge mode"}
