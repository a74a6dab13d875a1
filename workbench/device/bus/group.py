"""One question that many servos answer, one after the other: Sync Read of protocol 2, and Feetech's of the same number."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

Kind = Literal["sync", "feetech"]
SYNC_READ = 0x82
HEADER1, HEADER2 = b"\xff\xff", b"\xff\xff\xfd\x00"
STATUS = 0x55


def question(kind: Kind, servos: Sequence[int], address: int, count: int) -> bytes:
    """The packet that asks these servos, in this order, for `count` bytes from an address on."""
    if kind == "feetech":
        body = bytes([0xFE, len(servos) + 4, SYNC_READ, address, count, *servos])
        return HEADER1 + body + bytes([~sum(body) & 0xFF])
    body = bytes([SYNC_READ]) + address.to_bytes(2, "little") + count.to_bytes(2, "little") + bytes(servos)
    head = HEADER2 + b"\xfe" + (len(body) + 2).to_bytes(2, "little") + body
    return head + crc16(head).to_bytes(2, "little")


def answer_length(kind: Kind, count: int) -> int:
    """Bytes of one servo's answer."""
    return count + (6 if kind == "feetech" else 11)


def answers(kind: Kind, heard: bytes, count: int, servos: Sequence[int]) -> dict[int, tuple[int, bytes]]:
    """Error byte and data by ID, of every whole answer with `count` bytes of data; other bytes are skipped. Empty where an answer
    comes twice, out of turn, or from a servo that was not asked: then another program talks on the bus, and any of the answers
    may be to its questions."""
    out: dict[int, tuple[int, bytes]] = {}
    at, turn = 0, -1
    header = HEADER1 if kind == "feetech" else HEADER2
    while (at := heard.find(header, at)) >= 0:
        found = _protocol1(heard, at, count) if kind == "feetech" else _protocol2(heard, at, count)
        if found is None:
            at += 1
            continue
        servo, error, data, at = found
        if servo not in servos or servos.index(servo) <= turn:
            return {}
        turn = servos.index(servo)
        out[servo] = error, data
    return out


def _protocol1(heard: bytes, at: int, count: int) -> tuple[int, int, bytes, int] | None:
    end = at + count + 6
    if end > len(heard) or heard[at + 3] != count + 2 or ~sum(heard[at + 2:end - 1]) & 0xFF != heard[end - 1]:
        return None
    return heard[at + 2], heard[at + 4], heard[at + 5:end - 1], end


def _protocol2(heard: bytes, at: int, count: int) -> tuple[int, int, bytes, int] | None:
    if at + 7 > len(heard):
        return None
    end = at + 7 + int.from_bytes(heard[at + 5:at + 7], "little")
    whole = heard[at:end]
    if end > len(heard) or len(whole) < 11 or whole[7] != STATUS or crc16(whole[:-2]) != int.from_bytes(whole[-2:], "little"):
        return None
    data = whole[9:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
    return None if len(data) != count else (whole[4], whole[8], data, end)


def crc16(data: bytes) -> int:
    """Of protocol 2: polynomial 0x8005, from 0."""
    crc = 0
    for byte in data:
        crc = (crc << 8 ^ _CRC[(crc >> 8 ^ byte) & 0xFF]) & 0xFFFF
    return crc


def _row(byte: int) -> int:
    crc = byte << 8
    for _ in range(8):
        crc = crc << 1 ^ 0x8005 if crc & 0x8000 else crc << 1
    return crc & 0xFFFF


_CRC = tuple(map(_row, range(256)))
