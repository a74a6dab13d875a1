"""Dynamixel Protocol 1.0 as a servo hears and speaks it."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol as TypingProtocol

BROADCAST = 0xFE
PING, READ, WRITE, REG_WRITE, ACTION, RESET, REBOOT, SYNC_WRITE, SYNC_READ = 1, 2, 3, 4, 5, 6, 8, 0x83, 0x82
FAST_SYNC_READ, BULK_READ = 0x8A, 0x92


@dataclass(frozen=True)
class Instruction:
    """A packet that was addressed to somebody: ID, instruction, parameters; `intact` is False where its checksum is wrong."""

    servo: int
    instruction: int
    parameters: bytes
    intact: bool


class Protocol(TypingProtocol):
    """Packet format, as needed by a chain of servos."""

    def decoder(self) -> Callable[[int], Instruction | None]:
        """A new decoder: takes one byte, gives the packet that ends with it."""
        ...

    def status(self, servo: int, error: int, parameters: bytes) -> bytes:
        """The answer's bytes."""
        ...

    def identity(self, model: int, firmware: int) -> bytes:
        """The answer to a ping."""
        ...


class Protocol1:
    """FF FF, ID, length, instruction or error, parameters, complement of the sum."""

    def decoder(self) -> Callable[[int], Instruction | None]:
        """A new decoder: takes one byte, gives the packet that ends with it."""
        got = bytearray()

        def feed(value: int) -> Instruction | None:
            if len(got) < 2 and value != 0xFF:
                got.clear()
                return None
            if len(got) == 2 and value == 0xFF:  # more than two FF: the header is the last two
                return None
            got.append(value)
            if len(got) == 4 and value < 2:
                got.clear()
                return None
            if len(got) < 4 or len(got) < got[3] + 4:
                return None
            packet = bytes(got)
            got.clear()
            return Instruction(packet[2], packet[4], packet[5:-1], checksum(packet[2:-1]) == packet[-1])

        return feed

    def status(self, servo: int, error: int, parameters: bytes) -> bytes:
        """The answer's bytes."""
        return packet(servo, error, parameters)

    def identity(self, model: int, firmware: int) -> bytes:
        """The answer to a ping, which contains nothing else."""
        return b""


def checksum(body: bytes) -> int:
    """Complement of the sum of everything from the ID on."""
    return ~sum(body) & 0xFF


def packet(servo: int, instruction: int, parameters: bytes = b"") -> bytes:
    """An instruction packet, or a status packet where `instruction` is the error byte."""
    body = bytes([servo, len(parameters) + 2, instruction]) + parameters
    return b"\xff\xff" + body + bytes([checksum(body)])


def bit_flips(share: float, seed: int = 0) -> Callable[[int], int]:
    """A line that flips one random bit in this share of the bytes that pass."""
    rng = random.Random(seed)

    def flip(value: int) -> int:
        return value ^ (1 << rng.randrange(8)) if rng.random() < share else value

    return flip
