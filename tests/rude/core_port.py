"""A serial port with the controller's core, compiled for this machine, at its other end: the host's own code against it, fast."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

from tests.firmware.native import LINK_PC, Sim

BYTES_A_MS = 5.76
"""At 57,600 bit/s."""


class CorePort:
    """What `Controller` wants of a port; waiting lets the robot's milliseconds go by. each_ms: called after every one of them.

    unplugged: nothing goes through any more. flips: share of bytes in which a bit flips, both ways. sent: types of the frames
    that the host wrote."""

    def __init__(self, sim: Sim, each_ms: Callable[[], None] = lambda: None, seed: int = 0) -> None:
        self.sim, self.each_ms = sim, each_ms
        self.flips = 0.0
        self._rng = random.Random(seed)
        self.unplugged = False
        self.ms = 0
        self.sent: list[int] = []
        self._rx = b""

    def run(self, ms: int) -> None:
        """Lets time go by."""
        for _ in range(ms):
            self.sim.run(1)
            self.ms += 1
            self._rx += self._line(self.sim.received(LINK_PC))
            self.each_ms()

    def writePort(self, packet: Sequence[int]) -> int:
        """Sends; returns when it is out."""
        data = bytes(packet)
        self.sent.append(data[2])
        for at in range(0, len(data), 5):
            if not self.unplugged:
                self.sim.put(self._line(data[at:at + 5]))
            self.run(1)
        return len(data)

    def readPort(self, length: int) -> bytes:
        """Bytes that have come; without any, a millisecond goes by."""
        if not self._rx:
            self.run(1)
        got, self._rx = (b"", b"") if self.unplugged else (self._rx[:length], self._rx[length:])
        return got

    def _line(self, data: bytes) -> bytes:
        if not self.flips:
            return data
        return bytes(b ^ (1 << self._rng.randrange(8) if self._rng.random() < self.flips else 0) for b in data)

    def pause(self, seconds: float) -> None:
        """Lets time go by [s]."""
        self.run(max(round(seconds * 1000), 1))

    def getCurrentTime(self) -> float:
        """Milliseconds."""
        return float(self.ms)
