"""What packets tell, in the order in which they came: once while they are recorded, and once from the journal."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from typing import Any

from workbench.device.capture.packets import (
    BrokenPacketError,
    Frame,
    Message,
    ServerInfo,
    kind_of,
    parse_frame,
    parse_names,
    parse_server_info,
    stated_number,
)

FAR = 5000
"""Frames from the last one at which a number is no longer believed to be of the same stream (20 s at 240 Hz)."""
KEPT = 20
"""Broken packets whose bytes are kept, for whoever wants to know why."""
LONGEST_TRIP = 1.0
"""An echo that took longer is another one's, or broken [s]."""


@dataclass(frozen=True)
class Counts:
    """first, last: frame numbers. received: different frames that came whole. late: of these, after a later one. doubled: packets
    of a frame that was there. broken: packets not to be read. lost: frames between first and last of which nothing came."""

    first: int = -1
    last: int = -1
    received: int = 0
    late: int = 0
    doubled: int = 0
    broken: int = 0
    lost: int = 0


@dataclass(frozen=True)
class Echo:
    """One measurement of the server's clock [s]: the question's and the answer's time on this machine's, and the server's own."""

    sent: float
    received: float
    server: float


@dataclass
class Stream:
    """info: the server's own description. about: this program's note. names: of the rigid bodies, by number. broken: packets that
    could not be read, the first of them. jumps: how many frames in a row were of another stream; jumped_to: the number of the
    latest. problem: of the latest packet that could not be read."""

    info: ServerInfo | None = None
    about: dict[str, Any] = field(default_factory=dict)
    names: dict[int, str] = field(default_factory=dict)
    echoes: list[Echo] = field(default_factory=list)
    broken: list[bytes] = field(default_factory=list)
    jumps: int = 0
    jumped_to: int = -1
    problem: str = ""
    first: int = -1
    last: int = -1
    late: int = 0
    doubled: int = 0
    _seen: set[int] = field(default_factory=set)
    _cut: set[int] = field(default_factory=set)
    _broken: int = 0
    _unnamed: int = 0

    def take(self, arrival: float, data: bytes) -> Frame | None:
        """A packet that came at a time [s]; whatever it holds, this does not raise. Returns a frame that is whole and new."""
        try:
            kind = kind_of(data)
            if kind == Message.NOTE:
                self.about = json.loads(data[4:])
            elif self.info is None:
                self.info = parse_server_info(data)
            elif kind == Message.MODELDEF:
                self.names |= parse_names(data, self.info.version)
            elif kind == Message.ECHO_RESPONSE and len(data) >= 20:
                self._echo(arrival, *struct.unpack_from("<QQ", data, 4))
            elif kind == Message.FRAME:
                frame = parse_frame(data, self.info)
                return frame if self.count(frame.number) else None
        except BrokenPacketError as e:
            self.problem = str(e)
            self.broken += [data] * (len(self.broken) < KEPT)
            self.count_broken(stated_number(data))
        return None

    def count(self, number: int) -> bool:
        """A whole frame; whether it is new. Not where its number is of another stream: Motive was restarted or plays back."""
        if self._seen and not self._near(number):
            self.jumps, self.jumped_to = self.jumps + 1, number
            return False
        self.jumps = 0
        if number in self._seen:
            self.doubled += 1
            return False
        self.late += bool(self._seen) and number < self.last
        self.first = min(self.first, number) if self._seen else number
        self.last = max(self.last, number)
        self._seen.add(number)
        return True

    def count_broken(self, number: int | None) -> None:
        """A packet that could not be read; its frame's number, if that could."""
        self._broken += 1
        if number is None or (self._seen and not self._near(number)):
            self._unnamed += 1
        else:
            self._cut.add(number)

    def counts(self) -> Counts:
        """The counts so far."""
        span = self.last - self.first + 1 if self._seen else 0
        never_whole = sum(self.first < n < self.last for n in self._cut - self._seen)
        lost = max(span - len(self._seen) - never_whole - self._unnamed, 0)
        return Counts(self.first, self.last, len(self._seen), self.late, self.doubled, self._broken, lost)

    def _near(self, number: int) -> bool:
        return abs(number - self.last) <= FAR

    def _echo(self, arrival: float, sent: int, ticks: int) -> None:
        assert self.info is not None
        if 0 <= arrival - sent / 1e9 < LONGEST_TRIP:
            self.echoes.append(Echo(sent / 1e9, arrival, ticks / self.info.clock_frequency))
