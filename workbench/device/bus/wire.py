"""Bytes on a port, as they come: what answers a ping, how soon, and whether the adapter hears itself."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

from workbench.device.bus.errors import BusError, NoAnswerError
from workbench.device.bus.group import HEADER1, HEADER2, crc16

if TYPE_CHECKING:
    from workbench.device.bus.bus import Bus

NOBODY = 0xFC
"""ID that is asked to find out whether the adapter hears itself; who has it answers after the echo."""
SLOWEST = 50.0
"""How long an adapter may keep an answer [ms], beyond its bytes; FTDI chips keep it for 16 on Linux unless told otherwise."""
LEAST = 3.0
"""Time-out with the fastest adapter [ms]: occasional delay of a computer that does other things as well."""
QUESTIONS = 10
LONGEST_ANSWER = 256
"""Bytes of the longest packet that any servo sends."""


def ping(protocol: int, servo: int) -> bytes:
    """The packet."""
    if protocol == 1:
        body = bytes([servo, 2, 1])
        return HEADER1 + body + bytes([~sum(body) & 0xFF])
    head = HEADER2 + bytes([servo, 3, 0, 1])
    return head + crc16(head).to_bytes(2, "little")


def read_packet(protocol: int, servo: int, address: int, count: int) -> list[int]:
    """A READ as the SDK's packet handlers take it; they fill in header and checksum."""
    if protocol == 1:
        return [0, 0, servo, 4, 2, address, count, 0]
    return [0, 0, 0, 0, servo, 7, 0, 2, address & 0xFF, address >> 8, count & 0xFF, count >> 8, 0, 0]


def parameters_of(protocol: int, answer: list[int]) -> bytes:
    """As many parameters as the answer's own length states: the SDK's readTxRx takes the checksum for data where there are
    fewer."""
    if protocol == 1:
        return bytes(answer[5:answer[3] + 3])
    return bytes(answer[9:(answer[5] | answer[6] << 8) + 5])


def hear(port: Any, data: bytes, most: int, patience: float) -> bytes:
    """Everything received within the time of `most` bytes and `patience` [ms] after a packet."""
    port.clearPort()
    port.writePort(list(data))
    deadline = port.getCurrentTime() + (len(data) + most) * port.tx_time_per_byte + patience
    back = b""
    while port.getCurrentTime() < deadline:
        back += bytes(port.readPort(most))
    return back


def clean(protocol: int, answer: bytes) -> bool:
    """Whether this is one whole answer to a ping; a stray byte or two before it, as the bus turns round, are not the servo's."""
    length = 6 if protocol == 1 else 14
    at = answer.find(HEADER1 if protocol == 1 else HEADER2)
    packet = answer[at:at + length]
    if not 0 <= at <= 2 or len(answer) - at != length:
        return False
    if protocol == 1:
        return ~sum(packet[2:-1]) & 0xFF == packet[-1]
    return crc16(packet[:-2]) == int.from_bytes(packet[-2:], "little")


def collect(port: Any, packet: bytes, most: int) -> bytes:
    """Sends and listens until so many bytes are there, or none came for as long as the port has patience."""
    port.clearPort()
    port.writePort(list(packet))
    heard, last = bytearray(), port.getCurrentTime() + len(packet) * port.tx_time_per_byte
    while len(heard) < most and port.getCurrentTime() < last + port.patience + 70 * port.tx_time_per_byte:
        got = bytes(port.readPort(most - len(heard)))
        if got:
            heard, last = heard + got, port.getCurrentTime()
    return bytes(heard)


def wait_for_silence(port: Any) -> None:
    """Drops what still comes, until nothing has for as long as the port has patience, or any packet would have ended: whoever
    asks the next servo while two still answer loses that servo's answer as well."""
    quiet = port.getCurrentTime() + port.patience
    end = quiet + LONGEST_ANSWER * port.tx_time_per_byte
    while port.getCurrentTime() < min(quiet, end):
        if port.readPort(LONGEST_ANSWER):
            quiet = port.getCurrentTime() + port.patience


def hears_itself(port: Any, protocol: int) -> bool:
    """Whether a packet comes back."""
    sent = ping(protocol, NOBODY)
    return hear(port, sent, len(sent) + 14, SLOWEST).startswith(sent)


def measure_latency(bus: Bus, servo: int) -> float:
    """How long a servo's answers take beyond their bytes [s], the median of ten; the port's patience is set by the slowest of
    them. NoAnswerError where it does not answer with all the patience there is."""
    port, took = bus.port, []
    floor, port.patience = max(float(port.patience), LEAST), SLOWEST
    size = bus.profile.registers["id"].size
    bytes_of = (8 + 6 + size if bus.profile.protocol == 1 else 14 + 11 + size) * port.tx_time_per_byte
    try:
        for _ in range(QUESTIONS):
            begun = bus.now()
            with suppress(NoAnswerError):
                bus.read(servo, "id")
                took.append(1000 * (bus.now() - begun) - bytes_of)
    finally:
        port.patience = floor
    if not took:
        raise NoAnswerError("no answer", servo, bus.joints.get(servo))
    took.sort()
    port.patience = max(floor, min(1.5 * took[-1] + 2, SLOWEST))
    bus.latency = max(took[len(took) // 2], 0.0) / 1000
    return bus.latency


def slow_adapter(latency: float) -> str:
    """What to do about answers that come late by so much [s]; "" where it is no worth a word."""
    if latency < SLOW_ANSWERS:
        return ""
    return (f"answers come {1000 * latency:.0f} ms late: the adapter holds them. On Linux, set the latency of an FTDI chip by "
            "`echo 1 | sudo tee /sys/bus/usb-serial/devices/ttyUSB0/latency_timer`")


SLOW_ANSWERS = 2e-3
"""From here on it is worth a word [s]."""


def echo_error() -> BusError:
    """The error of an adapter that hears its own transmissions."""
    return BusError("the adapter echoes its own transmissions, so that every ID seems to answer; use one that does not "
                    "(U2D2, USB2Dynamixel), or add --echo")
