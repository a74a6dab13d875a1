"""The CM-530's own program from the computer: a table goes there, it plays it, and its log comes back, over the PC link."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench.device.bus.errors import BusError
from workbench.device.bus.ports import GONE, port_gone
from workbench.device.controller.telemetry import write_telemetry
from workbench.device.link import (
    AnswerMessage,
    ControllerState,
    FrameReader,
    FrameType,
    LogMessage,
    Message,
    StateMessage,
    decode_message,
    encode_frame,
    log_bytes,
    upload_frames,
)
from workbench.device.tables.table_file import TableFile, encode_table
from workbench.robot.mounting import JointServo, Mounting
from workbench.robot.servo_profile import ServoProfile
from workbench.types import Progress

ANSWER = 1.5
"""Until an order is answered, and a table of 4 kB checked [s]: the upload itself takes 0.7 s at 57,600 bit/s."""
TO_NEUTRAL = 20.0
"""Until the robot reaches neutral [s]: its ramp turns 150 deg in 5."""
REST = 1.0
"""How long it stands there before it plays [s]; a recording needs half a second of it."""
KEPT = 0.9
"""How much of that the joint log keeps [s]."""
SPARE = 0.5
"""How much longer than planned it may play [s]: its clock and the computer's, and a frame's way."""
SILENT = 1.0
"""Without a word from it while it plays, which sends 41 rounds a second [s]."""
ENDED = "the table came to its end"
UNCONFIRMED = "; the release was not confirmed, so the robot may still hold: hold START for 1.5 s, or switch it off"
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


class StopAskedError(Exception):
    """The user wants it to end; `reason` in words."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


class NothingPlayedError(BusError):
    """Stopped before it played, and released. reason: as given by `stop`."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(f"stopped: {reason}; nothing was played")


class Controller:
    """One conversation. port: dynamixel-sdk's, with `pause` (`SerialPort` at 57,600 bit/s, or a virtual one).

    stop: "" until it should end, then why. Every wait looks at it and raises StopAskedError, once for each reason."""

    def __init__(self, port: Any, stop: Callable[[], str] = lambda: "") -> None:
        self._port, self._reader = port, FrameReader()
        self._stop, self._heeded = stop, ""
        self.heard: list[tuple[float, Message]] = []

    def now(self) -> float:
        """The computer's clock [s]."""
        return float(self._port.getCurrentTime()) / 1000

    def state(self) -> StateMessage:
        """The controller's present state; BusError where nothing answers in its frames."""
        for _ in range(3):
            self._send(encode_frame(FrameType.ASK))
            found = self._wait(lambda m: isinstance(m, StateMessage), 0.5)
            if isinstance(found, StateMessage):
                return found
        raise BusError("no CM-530 with the workbench's program answers; `workbench flash` puts it there")

    def to_neutral(self) -> StateMessage:
        """Has it check its servos and ramp to neutral, if it is not there already; BusError names the state that it found."""
        state = self.state()
        if state.state == ControllerState.PLAY:
            raise BusError("the robot plays; stop it first (1 on the remote, or START)")
        if state.state in (ControllerState.STILL, ControllerState.LIMP):
            self._send(encode_frame(FrameType.PLAY))
        end = self.now() + TO_NEUTRAL
        while state.state != ControllerState.NEUTRAL:
            state = self._next_state(state, end)
            if state.state == ControllerState.LIMP:
                raise BusError(f"its torque stays off: {_reason(state)}")
        return state

    def _next_state(self, state: StateMessage, end: float) -> StateMessage:
        """The next state that it tells or, where that was lost on the way, that it tells when asked; BusError after `end`."""
        while self.now() < end:
            found = self._wait(lambda m: isinstance(m, StateMessage), min(1.0, end - self.now()))
            if isinstance(found, StateMessage):
                return found
            self._send(encode_frame(FrameType.ASK))
        raise BusError(f"it did not come to neutral in {TO_NEUTRAL:g} s; it is at {state.state.name}: {state.reason}")

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

    def start(self) -> float:
        """Has it play from neutral; returns when it began on its own clock [s]. BusError with its reason where it does not."""
        self._wait(lambda m: False, REST)
        self._send(encode_frame(FrameType.PLAY))
        began = self._wait(_on_the_way, ANSWER)
        if isinstance(began, StateMessage) and began.state == ControllerState.RAMP:  # the first pose is too far for its speed
            began = self._wait(_plays_or_gave_up, TO_NEUTRAL)
        if not isinstance(began, StateMessage) or began.state != ControllerState.PLAY:
            why = f": {_reason(began)}" if isinstance(began, StateMessage) else ""
            raise BusError("it was commanded to play, and does not" + why)
        return began.time

    def play(self, seconds: float, progress: Progress) -> tuple[float, str]:
        """Plays for so long; when it began on its own clock [s], and why it ended early ("": it played to its end)."""
        began = self.start()
        end = self.now() + seconds
        while True:
            left = self._wait(_has_left_play, min(0.1, max(end + SPARE - self.now(), 0.001)))
            if left is not None:
                final = left if isinstance(left, StateMessage) else self.state()
                return began, "" if final.reason == ENDED else _reason(final)
            if self.now() >= end + SPARE:
                return began, f"it still plays {SPARE:g} s after its end"
            if self.now() - self.heard[-1][0] > SILENT:
                raise BusError("the controller fell silent; the robot keeps playing: hold START for 1.5 s, or switch it off")
            progress("playing", min(1 - (end - self.now()) / seconds, 1.0))

    def back(self) -> str:
        """Sends a stop if it moves, and waits until it reaches neutral; returns "", or the reason why it did not."""
        end, state = self.now() + TO_NEUTRAL, self.state()
        if state.state in (ControllerState.CHECK, ControllerState.RAMP, ControllerState.PLAY):
            self._send(encode_frame(FrameType.STOP))
        while state.state not in (ControllerState.NEUTRAL, ControllerState.LIMP, ControllerState.STILL):
            state = self._next_state(state, end)
        return "" if state.state == ControllerState.NEUTRAL else _reason(state)

    def release(self) -> bool:
        """Torque off, whatever it is at and whatever is asked meanwhile; whether it said so."""
        self._stop = lambda: ""
        for _ in range(3):
            self._send(encode_frame(FrameType.RELEASE))
            if self._wait(lambda m: isinstance(m, StateMessage) and m.state == ControllerState.LIMP, 0.5) is not None:
                return True
        return False

    def began(self) -> float | None:
        """When it last began to play [s of its own clock], None where it never did."""
        playing = [m for _, m in self.heard if isinstance(m, StateMessage) and m.state == ControllerState.PLAY]
        return playing[-1].time if playing else None

    def clock_offset(self) -> float:
        """The computer's clock less the controller's [s]: the soonest arrival of a round, less what its bytes take."""
        rounds = [(t, m) for t, m in self.heard if isinstance(m, LogMessage)]
        return min(t - m.time - m.duration - log_bytes(len(m.goals)) * BYTE for t, m in rounds)

    def _send(self, data: bytes) -> None:
        try:
            self._port.writePort(list(data))
        except GONE as e:
            raise port_gone(e) from None

    def _wait(self, wanted: Callable[[Message], bool], seconds: float) -> Message | None:
        """The first message that is wanted, None after so long; all are kept."""
        end = self.now() + seconds
        while self.now() < end:
            reason = self._stop()
            if reason and reason != self._heeded:
                self._heeded = reason
                raise StopAskedError(reason)
            try:
                data = bytes(self._port.readPort(256))
            except GONE as e:
                raise port_gone(e) from None
            if not data:
                self._port.pause(0.001)
            hit = None
            for got in self._reader.feed(data):
                content = decode_message(got)
                if content is not None:
                    self.heard.append((self.now(), content))
                    hit = hit or (content if wanted(content) else None)
            if hit is not None:
                return hit
        return None


def play_by_controller(port: Any, table: TableFile, seconds: float, log: Path, profile: ServoProfile, stop: Callable[[], str],
                       progress: Progress | None = None) -> ControllerRun:
    """Upload, neutral, play, release, and the joint log of it. seconds: how long the table plays with its cycles.

    BusError in one line where the controller is not there, refuses the table, does not get to neutral, or was stopped before it
    played. However this ends, the robot is released, or the message says that nobody knows."""
    tell = progress or (lambda what, done: None)
    controller = Controller(port, stop)
    try:
        began, stopped = _perform(controller, table, seconds, tell)
    except BusError as e:
        raise BusError(f"{e}{'' if _let_go(controller) else UNCONFIRMED}") from None
    except BaseException:
        _let_go(controller)
        raise
    if not _let_go(controller):
        raise BusError((stopped or "played") + UNCONFIRMED)
    if began is None:
        raise NothingPlayedError(stopped)
    first = began + FIRST_POSE + (8 + 5 * len(table.table.joints)) * BUS_BYTE
    rounds = [m for _, m in controller.heard if isinstance(m, LogMessage) and first - KEPT <= m.time <= first + seconds]
    servos = [JointServo(profile, Mounting(joint.direction, zero=joint.neutral)) for joint in table.joints]
    write_telemetry(log, rounds, table.table.joints, servos)
    started = first + controller.clock_offset()
    zero = rounds[0].time + rounds[0].duration / 2
    return ControllerRun(started, started + seconds, first - zero, len(rounds), stopped)


def _perform(controller: Controller, table: TableFile, seconds: float,
             tell: Progress) -> tuple[float | None, str]:
    """Upload, neutral, play, neutral. The table goes first: one that is refused moves nothing. When it began (None: it did not),
    and why it ended early."""
    began, stopped = None, ""
    try:
        try:
            tell("uploading", None)
            controller.upload(table)
            tell("to neutral", None)
            controller.to_neutral()
            began, stopped = controller.play(seconds, tell)
        except StopAskedError as e:
            began, stopped = controller.began(), e.reason
        tell("back to neutral", None)
        why = controller.back()
        return began, stopped or why
    except StopAskedError as e:
        return began, e.reason


def _let_go(controller: Controller) -> bool:
    try:
        return controller.release()
    except BusError:
        return False


def _has_left_play(m: Message) -> bool:
    return isinstance(m, StateMessage | LogMessage) and m.state != ControllerState.PLAY


def _on_the_way(m: Message) -> bool:
    return isinstance(m, StateMessage) and m.state in (ControllerState.PLAY, ControllerState.RAMP)


def _plays_or_gave_up(m: Message) -> bool:
    return isinstance(m, StateMessage) and m.state != ControllerState.RAMP


def _reason(state: StateMessage) -> str:
    return state.reason + (f" (servo {state.servo})" if state.servo is not None else "")
