"""The host side of `run --upload` against the controller's core: stops at every moment, refusals, a cut line, no torque left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from tests.firmware.native import Sim, walk
from tests.rude.core_port import CorePort
from workbench.device.bus import BusError
from workbench.device.controller.play import ControllerRun, play_by_controller
from workbench.device.link import FrameType, encode_frame
from workbench.device.tables.table_file import JointBounds, TableFile, bounds_of
from workbench.motion import load_motion
from workbench.robot import data_file, puppy_model
from workbench.robot.servo_profile_file import servo_profile

WALK = load_motion(data_file("robotis_walk.csv")).as_table()
BOUNDS = bounds_of(WALK, puppy_model())


class Watched:
    """A robot that runs the core, with a record of the packets from the host and of the goals away from neutral."""

    def __init__(self) -> None:
        self.sim = Sim(walk())
        self.port = CorePort(self.sim, self.look)
        self.away = False
        self.plays: int | None = None
        self.port.run(300)

    def look(self) -> None:
        if any(abs(self.sim.get("goal", j) - 512) > 14 for j in range(15) if self.sim.get("torque", j)):
            self.away = True
        if self.sim.get("state") == 5 and self.plays is None:
            self.plays = self.port.ms

    def torque(self) -> int:
        return sum(self.sim.get("torque", j) for j in range(15))

    def play(self, folder: Path, stop: Callable[[], str] = lambda: "", cycles: int = 3,
             joints: tuple[JointBounds, ...] = BOUNDS) -> ControllerRun:
        file = TableFile(WALK, joints, cycles, True)
        return play_by_controller(self.port, file, 0.468 * cycles, folder / "log.csv", servo_profile("AX-12A"), stop)

    def walking(self, ms: int) -> bool:
        """Whether it has walked for so long."""
        return self.plays is not None and self.port.ms - self.plays >= ms


def test_a_played_table_ends_in_a_release(tmp_path: Path) -> None:
    w = Watched()
    done = w.play(tmp_path)
    assert (done.stopped, w.torque(), w.away) == ("", 0, True)


def test_the_host_sends_nothing_that_gives_torque_back_after_the_owner_let_go(tmp_path: Path) -> None:
    w = Watched()
    began = [0]

    def stop() -> str:
        if w.walking(1000) and not began[0]:
            began[0] = len(w.port.sent)
            w.sim.set("start", 1)
        return ""

    done = w.play(tmp_path, stop, cycles=20)
    assert "START was held" in done.stopped
    assert not {FrameType.PLAY, FrameType.STOP} & set(w.port.sent[began[0]:])
    w.sim.set("start", 0)
    w.port.run(3000)
    assert w.torque() == 0


@pytest.mark.parametrize("at", [0, 310, 340, 400, 700, 1100])
def test_ctrl_c_before_the_walk_never_starts_it(tmp_path: Path, at: int) -> None:
    w = Watched()
    with pytest.raises(BusError, match="stopped: Ctrl-C; nothing was played"):
        w.play(tmp_path, lambda: "Ctrl-C" if w.port.ms >= at else "")
    w.port.run(2000)
    assert (w.torque(), w.away, w.plays) == (0, False, None)


def test_ctrl_c_in_the_walk_brings_it_to_neutral_and_lets_go(tmp_path: Path) -> None:
    w = Watched()
    done = w.play(tmp_path, lambda: "Ctrl-C" if w.walking(800) else "", cycles=30)
    assert (done.stopped, w.torque()) == ("Ctrl-C", 0)
    assert FrameType.STOP in w.port.sent
    assert all(abs(w.sim.get("position", j) - 512) < 30 for j in range(15))


def test_a_second_ctrl_c_releases_at_once(tmp_path: Path) -> None:
    w = Watched()

    def stop() -> str:
        return "Ctrl-C, twice" if w.walking(900) else "Ctrl-C" if w.walking(800) else ""

    done = w.play(tmp_path, stop, cycles=30)
    assert (done.stopped, w.torque()) == ("Ctrl-C, twice", 0)
    assert w.port.ms - (w.plays or 0) < 1000


def test_a_refused_table_moves_nothing(tmp_path: Path) -> None:
    w = Watched()
    w.port.writePort(encode_frame(FrameType.RELEASE))
    w.port.run(100)
    with pytest.raises(BusError, match="the table is refused: bounds"):
        w.play(tmp_path, joints=(replace(BOUNDS[0], low=0, high=1023), *BOUNDS[1:]))
    w.port.run(1000)
    assert (w.torque(), w.away) == (0, False)


def test_an_answer_that_is_lost_leaves_no_torque(tmp_path: Path) -> None:
    w = Watched()
    read = w.port.readPort

    def deaf(length: int) -> bytes:
        data = read(length)
        return b"" if FrameType.END in w.port.sent and FrameType.RELEASE not in w.port.sent else data

    w.port.readPort = deaf  # type: ignore[method-assign]
    with pytest.raises(BusError, match="was sent, but not confirmed"):
        w.play(tmp_path)
    assert w.torque() == 0


def test_a_link_that_is_cut_in_the_walk_is_said_and_so_is_what_nobody_knows(tmp_path: Path) -> None:
    w = Watched()

    def stop() -> str:
        w.port.unplugged = w.walking(700)
        return ""

    with pytest.raises(BusError, match=r"fell silent.*not confirmed"):
        w.play(tmp_path, stop, cycles=20)
    w.port.run(12_000)
    assert w.sim.get("state") == 4  # its cycles are over: it stands in neutral


def test_a_servo_that_fails_in_the_walk_is_the_reason(tmp_path: Path) -> None:
    w = Watched()

    def stop() -> str:
        if w.walking(500):
            w.sim.set("mute", 1, 3)
        return ""

    done = w.play(tmp_path, stop, cycles=20)
    assert done.stopped == f"a servo is silent (servo {w.sim.get('id', 3)})"
    w.sim.set("mute", 0, 3)
    w.port.run(300)
    assert w.torque() == 0
