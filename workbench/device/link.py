"""Frames on the PC link and over ZigBee, as the controller's program sends and receives them (layout in docs/robot.md)."""

from __future__ import annotations

import binascii
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

SYNC = b"\xa5\x5a"
PAYLOAD = 204
"""Longest payload of a frame [bytes]."""
HEAD = 5
"""Length of a frame's head [bytes]: SYNC, type, number, length of the payload."""


class FrameType(IntEnum):
    """Type of a frame; types from 0x80 on come from the controller."""

    ASK = 0x01
    PLAY = 0x02
    STOP = 0x03
    RELEASE = 0x04
    BEGIN = 0x10
    DATA = 0x11
    END = 0x12
    BRIDGE = 0x20
    BRIDGE_END = 0x21
    STATE = 0x80
    ANSWER = 0x81
    LOG = 0x90


class ControllerState(IntEnum):
    """State of the controller (firmware/core/robot.h)."""

    STILL = 0
    LIMP = 1
    CHECK = 2
    RAMP = 3
    NEUTRAL = 4
    PLAY = 5
    STOP = 6
    YIELD = 7
    BRIDGE = 8


REASONS = (
    "none", "power on", "reset button", "watchdog: the program hung", "reset by program", "brown-out", "button", "remote",
    "PC link",
    "the table came to its end", "a servo is silent", "a servo's answers are garbled (two with one ID, or a bad line)",
    "a servo of another model", "a servo is overloaded", "a servo is hot", "the battery is low", "the servos' supply is dead",
    "a device babbles on the bus", "a joint did not arrive", "a servo does not take its goal",
    "a servo's angle limits are narrower than the table", "START was held", "the PC fell silent in bridge mode",
    "the built-in table is broken", "a joint was moving before torque went on",
    "nobody used it for five minutes",
)
"""Why a state was entered, by the controller's number."""

TABLE_FAULTS = (
    "none", "too short", "not a table", "another version", "number of joints", "no poses", "flags", "size", "bus IDs", "bounds",
    "a dwell", "a goal out of bounds", "a speed out of bounds", "CRC", "for another robot", "its first pose is out of reach",
)
UPLOAD_RESULTS = ("taken", "another upload is under way", "no upload is under way", "bytes are missing",
                  "its number was there before", "too big", "malformed")
UPLOAD_FAULT = 0x10


@dataclass(frozen=True)
class Frame:
    """One frame: type, its number (0 to 255), payload."""

    type: int
    number: int
    payload: bytes


@dataclass(frozen=True)
class StateMessage:
    """State of the controller since `time` [s on its own clock]. reason: why it was entered. servo: bus ID of the servo
    responsible, or None. woke_from: cause of the last reset. table_fault: of the last table. accepted: number of the last
    accepted table. battery [V]."""

    time: float
    state: ControllerState
    reason: str
    servo: int | None
    woke_from: str
    table_fault: str
    accepted: int
    battery: float


@dataclass(frozen=True)
class AnswerMessage:
    """The controller's answer to a frame: the frame's type and number, the result in words, how many bytes of a table have
    arrived, and whether it was accepted (`well`)."""

    type: int
    number: int
    result: str
    received: int
    well: bool


@dataclass(frozen=True)
class SlowReading:
    """Readings of one joint that are sent seldom: speed and load [register counts], voltage [V], temperature [deg C]."""

    joint: int
    speed: int
    load: int
    voltage: float
    temperature: int


@dataclass(frozen=True)
class LogMessage:
    """One round of readings: it began at `time` [s of the controller's clock] and took `duration` [s], joints evenly in between.

    goals, positions: (n,) counts; position None where the servo did not answer. slow: three joints' slow values. pose: counts of
    poses sent in this cycle.
    """

    time: float
    duration: float
    state: ControllerState
    pose: int
    battery: float
    goals: tuple[int, ...]
    positions: tuple[int | None, ...]
    slow: tuple[SlowReading, ...]


Message = StateMessage | AnswerMessage | LogMessage

_STATE = struct.Struct("<I6BH")
_ANSWER = struct.Struct("<BBHB")
_LOG = struct.Struct("<IBBHBHI")
_SLOW = struct.Struct("<HHBB")


def crc16(data: bytes) -> int:
    """CRC-16-CCITT, initial value 0xFFFF."""
    return binascii.crc_hqx(data, 0xFFFF)


def encode_frame(kind: int, payload: bytes = b"", number: int = 0) -> bytes:
    """The bytes of a frame; ValueError where the payload is too long."""
    if len(payload) > PAYLOAD:
        raise ValueError(f"payload of {len(payload)} bytes; a frame takes {PAYLOAD}")
    body = bytes([kind, number, len(payload)]) + payload
    return SYNC + body + struct.pack("<H", crc16(body))


class FrameReader:
    """Finds whole frames with a valid checksum in a stream. Bytes that only began as a frame, such as one that a reset cut off,
    are searched again: they may hold the beginning of others."""

    def __init__(self) -> None:
        self._pending = bytearray()

    def feed(self, data: bytes) -> Iterator[Frame]:
        """Adds bytes to the stream; yields the frames that end in them."""
        pending = self._pending
        pending += data
        while True:
            at = pending.find(SYNC)
            del pending[:at if at >= 0 else len(pending) - pending.endswith(SYNC[:1])]
            if len(pending) < HEAD or (pending[HEAD - 1] <= PAYLOAD and len(pending) < HEAD + pending[HEAD - 1] + 2):
                return
            whole = bytes(pending[len(SYNC):HEAD + pending[HEAD - 1] + 2])
            if pending[HEAD - 1] > PAYLOAD or crc16(whole[:-2]) != struct.unpack("<H", whole[-2:])[0]:
                del pending[:len(SYNC)]
                continue
            del pending[:len(SYNC) + len(whole)]
            yield Frame(whole[0], whole[1], whole[3:-2])


def decode_message(got: Frame) -> Message | None:
    """The content of a frame from the controller; None for an unknown type, or a payload that does not fit its type."""
    try:
        if got.type == FrameType.STATE:
            return _state(got.payload)
        if got.type == FrameType.ANSWER:
            return _answer(got)
        if got.type == FrameType.LOG:
            return _log(got)
    except (struct.error, ValueError, IndexError):
        pass
    return None


def _state(payload: bytes) -> StateMessage:
    ms, state, reason, servo, cause, fault, accepted, battery = _STATE.unpack(payload)
    return StateMessage(ms / 1000, ControllerState(state), REASONS[reason], None if servo == 0xFF else servo, REASONS[cause],
                        TABLE_FAULTS[fault], accepted, battery / 10)


def _answer(got: Frame) -> AnswerMessage:
    kind, code, received, _ = _ANSWER.unpack(got.payload)
    result = TABLE_FAULTS[code - UPLOAD_FAULT] if code >= UPLOAD_FAULT else UPLOAD_RESULTS[code]
    return AnswerMessage(kind, got.number, result, received, code == 0)


def log_bytes(joints: int) -> int:
    """Length of a LOG frame of so many joints [bytes]."""
    return len(encode_frame(FrameType.LOG, bytes(_LOG.size + 4 * joints + 3 * _SLOW.size)))


def _log(got: Frame) -> LogMessage:
    """A log frame's number is its number of joints."""
    n = got.number
    ms, took, state, pose, first, battery, answered = _LOG.unpack_from(got.payload)
    if len(got.payload) != _LOG.size + 4 * n + 3 * _SLOW.size:
        raise ValueError("another number of joints")
    counts = struct.unpack_from(f"<{2 * n}H", got.payload, _LOG.size)
    slow = []
    for k in range(3):
        speed, load, volts, heat = _SLOW.unpack_from(got.payload, _LOG.size + 4 * n + _SLOW.size * k)
        slow.append(SlowReading((first + k) % n, speed, load, volts / 10, heat))
    positions = tuple(p if answered >> j & 1 else None for j, p in enumerate(counts[1::2]))
    return LogMessage(ms / 1000, took / 1000, ControllerState(state), pose, battery / 10, counts[::2], positions, tuple(slow))


def upload_frames(table: bytes, sequence: int, ramps: bool = False) -> list[bytes]:
    """Frames that transfer a table: BEGIN, DATA in order, END. sequence: one more than the last accepted, modulo 256. ramps:
    whether the controller ramps to a first pose that is out of reach, instead of refusing the table."""
    begin = struct.pack("<IIBB", len(table), binascii.crc32(table), sequence, int(ramps))
    step = PAYLOAD - 4
    data = [encode_frame(FrameType.DATA, struct.pack("<H", at) + table[at:at + step]) for at in range(0, len(table), step)]
    return [encode_frame(FrameType.BEGIN, begin), *data, encode_frame(FrameType.END)]
