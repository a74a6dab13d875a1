"""Dynamixel Protocol 2.0 as a servo hears and speaks it (ROBOTIS e-manual, Protocol 2.0)."""

from __future__ import annotations

from collections.abc import Callable

from workbench.device.virtual.protocol import FAST_SYNC_READ, PING, READ, SYNC_READ, SYNC_WRITE, WRITE, Instruction

HEADER = b"\xff\xff\xfd\x00"
STATUS = 0x55
ALERT = 0x80
_NUMBERS = {1 << 6: 2, 1 << 4: 3, 1 << 3: 4, 1 << 1: 6}
"""Protocol 1's error bits of an instruction (unknown, checksum, range, angle) as Protocol 2's error numbers."""
_STATE = 1 << 0 | 1 << 2 | 1 << 5
"""Voltage, heat, overload: the alert bit, and the register hardware_error says which."""


class Protocol2:
    """FF FF FD 00, ID, length, instruction, parameters, CRC-16; addresses have two bytes, of which families here use one."""

    def decoder(self) -> Callable[[int], Instruction | None]:
        """A new decoder: takes one byte, gives the packet that ends with it."""
        got = bytearray()

        def feed(value: int) -> Instruction | None:
            got.append(value)
            while got and not HEADER.startswith(bytes(got[:4])):
                del got[0]
            if len(got) < 7:
                return None
            length = int.from_bytes(got[5:7], "little")
            if length < 3 or length > 300:
                del got[0]
                return None
            if len(got) < length + 7:
                return None
            packet = bytes(got[:length + 7])
            got.clear()
            intact = crc16(packet[:-2]) == int.from_bytes(packet[-2:], "little")
            return Instruction(packet[4], packet[7], _narrow(packet[7], unstuff(packet[8:-2])), intact)

        return feed

    def status(self, servo: int, error: int, parameters: bytes) -> bytes:
        """The answer's bytes; error as Protocol 1's bits."""
        number = next((n for bit, n in _NUMBERS.items() if error & bit), 0)
        return packet(servo, STATUS, bytes([number | (ALERT if error & _STATE else 0)]) + parameters)

    def block(self, so_far: bytes, servo: int, error: int, parameters: bytes) -> bytes:
        """A servo's part of the single packet that answers a Fast Sync Read. so_far: the packet up to there."""
        number = next((n for bit, n in _NUMBERS.items() if error & bit), 0)
        body = bytes([number | (ALERT if error & _STATE else 0), servo]) + parameters
        return body + crc16(so_far + body).to_bytes(2, "little")

    def identity(self, model: int, firmware: int) -> bytes:
        """The answer to a ping."""
        return model.to_bytes(2, "little") + bytes([firmware])


def packet(servo: int, instruction: int, parameters: bytes) -> bytes:
    """A whole packet."""
    body = stuff(parameters)
    head = HEADER + bytes([servo]) + (len(body) + 3).to_bytes(2, "little") + bytes([instruction]) + body
    return head + crc16(head).to_bytes(2, "little")


def stuff(parameters: bytes) -> bytes:
    """FF FF FD inside parameters becomes FF FF FD FD."""
    return parameters.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")


def unstuff(parameters: bytes) -> bytes:
    """The way back."""
    return parameters.replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")


def crc16(data: bytes) -> int:
    """CRC-16/UMTS: polynomial 0x8005, from 0."""
    crc = 0
    for byte in data:
        crc = (crc << 8 ^ _CRC[crc >> 8 ^ byte]) & 0xFFFF
    return crc


def _crc_of_byte(byte: int) -> int:
    """A byte's share of the CRC, bit by bit."""
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1 ^ 0x8005 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


_CRC = tuple(map(_crc_of_byte, range(256)))


def _narrow(instruction: int, parameters: bytes) -> bytes:
    """Parameters with addresses and lengths of one byte, as the servo's conduct has them."""
    if instruction in (READ, SYNC_WRITE, SYNC_READ, FAST_SYNC_READ) and len(parameters) >= 4:
        return bytes([parameters[0], parameters[2]]) + parameters[4:]
    if instruction == WRITE and len(parameters) >= 2:
        return parameters[:1] + parameters[2:]
    return b"" if instruction == PING else parameters
