"""One question that many servos answer, one after the other.

sync: Sync Read of protocol 2. fast: Fast Sync Read, answered by blocks of a single packet, each with a CRC of the packet so far.
feetech: Feetech's Sync Read in frames of protocol 1. bulk: Bulk Read of protocol 1, which the MX series knows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

Kind = Literal["sync", "feetech", "fast", "bulk"]
SYNC_READ, FAST_SYNC_READ, BULK_READ = 0x82, 0x8A, 0x92
HEADER1, HEADER2 = b"\xff\xff", b"\xff\xff\xfd\x00"
STATUS = 0x55
FAST_HEAD = 8
"""Bytes of a Fast Sync Read's answer before its first block."""


def question(kind: Kind, servos: Sequence[int], address: int, count: int) -> bytes:
    """The packet that asks these servos, in this order, for `count` bytes from an address on."""
    if kind in ("feetech", "bulk"):
        each = bytes([SYNC_READ, address, count, *servos])
        if kind == "bulk":
            each = bytes([BULK_READ, 0]) + b"".join(bytes([count, servo, address]) for servo in servos)
        body = bytes([0xFE, len(each) + 1]) + each
        return HEADER1 + body + bytes([~sum(body) & 0xFF])
    instruction = SYNC_READ if kind == "sync" else FAST_SYNC_READ
    body = bytes([instruction]) + address.to_bytes(2, "little") + count.to_bytes(2, "little") + bytes(servos)
    head = HEADER2 + b"\xfe" + (len(body) + 2).to_bytes(2, "little") + body
    return head + crc16(head).to_bytes(2, "little")


def answer_length(kind: Kind, count: int) -> int:
    """Bytes of one servo's answer."""
    return count + {"feetech": 6, "bulk": 6, "sync": 11, "fast": 4}[kind]


def reply_length(kind: Kind, servos: int, count: int) -> int:
    """Bytes of the answers together."""
    return servos * answer_length(kind, count) + (FAST_HEAD if kind == "fast" else 0)


def answers(kind: Kind, heard: bytes, count: int, servos: Sequence[int]) -> dict[int, tuple[int, bytes]]:
    """Error byte and data by ID, of every whole answer with `count` bytes of data; other bytes are skipped. Empty where an answer
    comes twice, out of turn, or from a servo that was not asked: then another program talks on the bus, and any of the answers
    may be to its questions."""
    out: dict[int, tuple[int, bytes]] = {}
    turn = -1
    for servo, error, data in _blocks(heard, count) if kind == "fast" else _packets(kind, heard, count):
        if servo not in servos or servos.index(servo) <= turn:
            return {}
        turn = servos.index(servo)
        out[servo] = error, data
    return out


def _packets(kind: Kind, heard: bytes, count: int) -> Iterator[tuple[int, int, bytes]]:
    """ID, error and data of each whole packet."""
    one, header = (_protocol2, HEADER2) if kind == "sync" else (_protocol1, HEADER1)
    at = 0
    while (at := heard.find(header, at)) >= 0:
        found = one(heard, at, count)
        if found is None:
            at += 1
            continue
        servo, error, data, at = found
        yield servo, error, data


def _blocks(heard: bytes, count: int) -> Iterator[tuple[int, int, bytes]]:
    """ID, error and data of each block of the one packet, up to the first that is broken or missing."""
    at = heard.find(HEADER2 + b"\xfe")
    if at < 0 or heard[at + 7:at + FAST_HEAD] != bytes([STATUS]):
        return
    begin = at + FAST_HEAD
    while (end := begin + count + 4) <= len(heard):
        if crc16(heard[at:end - 2]) != int.from_bytes(heard[end - 2:end], "little"):
            return
        yield heard[begin + 1], heard[begin], heard[begin + 2:end - 2]
        begin = end


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
    """Checksum of protocol 2: polynomial 0x8005, initial value 0."""
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
