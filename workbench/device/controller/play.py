"""The CM-530's own program from the computer: a table goes there, it plays it, and its log comes back, over the PC link."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench.device.bus.errors import BusError
from workbench.device.bus.ports import GONE, gone
from workbench.device.controller.telemetry import write_telemetry
from workbench.device.link import (
    AnswerMessage,
    ControllerState,
    FrameReader,
    FrameType,
    LogMessage,
    Message,
    StateMessage,
    frame,
    log_bytes,
    message,
    upload_frames,
)
from workbench.device.tables.table_file import TableFile, encode_table
from workbench.robot.servo_profile import ServoProfile

ANSWER = 1.5
"""Until an order is answered, and a table of 4 kB checked [s]: the upload itself takes 0.7 s at 57,600 bit/s."""
TO_NEUTRAL = 20.0
"""Until the robot stands in neutral [s]: its ramp turns 150 deg in 5."""
REST = 1.0
"""How long it stands there before it plays [s]; a recording needs half a second of it."""
KEPT = 0.9
"""How much of that the joint log keeps [s]."""
BYTE = 10 / 57_600
FIRST_POSE = 0.004
"""From where it says that it plays to the first pose's packet [s]: POSE_GUARD_MS of its program."""
BUS_BYTE = 1e-5
"""On the servos' bus [s]. A pose counts from its packet's end, as servos act then."""


@dataclass(frozen=True)
class ControllerRun:
    """started, ended: of the motion, on the computer's clock [s], from the frames' arrival less the time that their bytes take.
    start_in_log: the first pose's time in the joint log [s]. stopped: why it ended early, "" where it did not."""

    started: float
    ended: float
    start_in_log: float
    rounds: int
    stopped: str


class Controller:
    """One conversation. port: dynamixel-sdk's, with `pause` (`SerialPort` at 57,600 bit/s, or a virtual one)."""

    def __init__(self, port: Any) -> None:
        self._port, self._reader = port, FrameReader()
        self.heard: list[tuple[float, Message]] = []

    def now(self) -> float:
        """The computer's clock [s]."""
        return float(self._port.getCurrentTime()) / 1000

    def state(self) -> StateMessage:
        """What it is at; BusError where nothing that speaks its frames is there."""
        for _ in range(3):
            self._send(frame(FrameType.ASK))
            found = self._wait(lambda m: isinstance(m, StateMessage), 0.5)
            if isinstance(found, StateMessage):
                return found
        raise BusError("no CM-530 with the workbench's program answers; `workbench flash` puts it there")

    def to_neutral(self) -> StateMessage:
        """Has it check its servos and ramp to neutral, if it does not stand there; BusError says what it found instead."""
        state = self.state()
        if state.state == ControllerState.PLAY:
            raise BusError("the robot plays; stop it first (1 on the remote, or START)")
        if state.state in (ControllerState.STILL, ControllerState.LIMP):
            self._send(frame(FrameType.PLAY))
        end = self.now() + TO_NEUTRAL
        while state.state != ControllerState.NEUTRAL:
            found = self._wait(lambda m: isinstance(m, StateMessage), end - self.now())
            if not isinstance(found, StateMessage):
                raise BusError(f"it did not come to neutral in {TO_NEUTRAL:g} s; it is at {state.state.name}: {state.reason}")
            state = found
            if state.state == ControllerState.LIMP:
                raise BusError(f"its torque stays off: {_reason(state)}")
        return state

    def upload(self, table: TableFile) -> None:
        """Brings a table over, to be played from its first pose on; BusError with the controller's reason where it is refused."""
        data = encode_table(table)
        sequence = (self.state().accepted + 1) % 256
        for part in upload_frames(data, sequence, ramps=True):
            self._send(part)
        answer = self._wait(lambda m: isinstance(m, AnswerMessage) and (m.type == FrameType.END or not m.well), ANSWER)
        if not isinstance(answer, AnswerMessage):
            raise BusError("the table was sent, but not confirmed")
        if not answer.well:
            raise BusError(f"the table is refused: {answer.result}")

    def play(self, seconds: float, stop: Callable[[], str], progress: Callable[[str, float | None], None]) -> tuple[float, str]:
        """Plays for so long; the time at which it began on its own clock [s], and why it ended early."""
        self._wait(lambda m: False, REST)
        self._send(frame(FrameType.PLAY))
        began = self._wait(lambda m: isinstance(m, StateMessage) and m.state == ControllerState.PLAY, ANSWER)
        if not isinstance(began, StateMessage):
            raise BusError("it was commanded to play, and does not")
        end, stopped = self.now() + seconds, ""
        while self.now() < end and not stopped:
            progress("playing", 1 - (end - self.now()) / seconds)
            left = self._wait(_left_play, min(0.1, end - self.now()))
            if isinstance(left, StateMessage) and self.now() < end - 0.05:
                stopped = _reason(left)
            elif stop():
                stopped = stop()
        if stopped:
            self._send(frame(FrameType.STOP))
        return began.time, stopped

    def release(self) -> None:
        """Torque off, once it stands in neutral again, or after a while anyway."""
        self._wait(lambda m: isinstance(m, StateMessage) and m.state == ControllerState.NEUTRAL, 8.0)
        self._send(frame(FrameType.RELEASE))
        self._wait(lambda m: isinstance(m, StateMessage) and m.state == ControllerState.LIMP, ANSWER)

    def clock_offset(self) -> float:
        """The computer's clock less the controller's [s]: the soonest arrival of a round, less what its bytes take."""
        rounds = [(t, m) for t, m in self.heard if isinstance(m, LogMessage)]
        return min(t - m.time - m.duration - log_bytes(len(m.goals)) * BYTE for t, m in rounds)

    def _send(self, data: bytes) -> None:
        try:
            self._port.writePort(list(data))
        except GONE as e:
            raise gone(e) from None

    def _wait(self, wanted: Callable[[Message], bool], seconds: float) -> Message | None:
        """The first message that is wanted, None after so long; all are kept."""
        end = self.now() + seconds
        while self.now() < end:
            try:
                data = bytes(self._port.readPort(256))
            except GONE as e:
                raise gone(e) from None
            if not data:
                self._port.pause(0.001)
            hit = None
            for got in self._reader.feed(data):
                said = message(got)
                if said is not None:
                    self.heard.append((self.now(), said))
                    hit = hit or (said if wanted(said) else None)
            if hit is not None:
                return hit
        return None


def play_by_controller(port: Any, table: TableFile, seconds: float, log: Path, profile: ServoProfile, stop: Callable[[], str],
                       progress: Callable[[str, float | None], None] | None = None) -> ControllerRun:
    """Neutral, upload, play, release, and the joint log of it. seconds: how long the table plays with its cycles.

    BusError in one line where the controller is not there, does not get to neutral, or refuses the table."""
    tell = progress or (lambda what, done: None)
    controller = Controller(port)
    tell("to neutral", None)
    controller.to_neutral()
    tell("uploading", None)
    controller.upload(table)
    began, stopped = controller.play(seconds, stop, tell)
    first = began + FIRST_POSE + (8 + 5 * len(table.table.joints)) * BUS_BYTE
    tell("back to neutral", None)
    controller.release()
    rounds = [m for _, m in controller.heard if isinstance(m, LogMessage) and first - KEPT <= m.time <= first + seconds]
    write_telemetry(log, rounds, table.table.joints, profile)
    started = first + controller.clock_offset()
    zero = rounds[0].time + rounds[0].duration / 2
    return ControllerRun(started, started + seconds, first - zero, len(rounds), stopped)


def _left_play(said: Message) -> bool:
    return isinstance(said, StateMessage) and said.state != ControllerState.PLAY


def _reason(state: StateMessage) -> str:
    return state.reason + (f" (servo {state.servo})" if state.servo is not None else "")
