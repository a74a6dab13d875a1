"""dynamixel-sdk in virtual time: a port whose clock and wire are ours. Waiting costs no wall time."""

from __future__ import annotations

import random
from collections import deque
from collections.abc import Sequence
from functools import partial

from workbench.device.bus.ports import PatientPort
from workbench.device.virtual.bus import ServoBus
from workbench.device.virtual.clock import MILLISECOND, SECOND

CHUNK = 62
"""Bytes that an FTDI chip hands over at once, without waiting for more."""


class MemoryPort(PatientPort):
    """A port without hardware, at any rate; a rate that the other side does not have reads as noise or silence."""

    def setupPort(self, cflag_baud: int) -> bool:
        """Sets the rate, and opens."""
        self.baudrate = cflag_baud
        self.tx_time_per_byte = 10_000 / cflag_baud
        self.is_open = True
        return True

    def closePort(self) -> None:
        """Closes."""
        self.is_open = False


class VirtualPort(MemoryPort):
    """An adapter such as the U2D2 on a virtual bus; `echo` hears itself, as adapters without direction control do.

    unplugged: as if pulled out: raises the operating system's error. latency: longest time that bytes are held, as by an
    FTDI chip where they are fewer than 62 [s]; jitter: largest reduction of it [s].
    """

    def __init__(self, bus: ServoBus, rate: int = 1_000_000, echo: bool = False) -> None:
        super().__init__("virtual")
        self.bus, self.echo = bus, echo
        self.unplugged = False
        self.latency, self.jitter, self._rng = 0.0, 0.0, random.Random(0)
        self._kept: list[int] = []
        self._rx: deque[int] = deque()
        self._sending_until = 0
        bus.join(self)
        self.setupPort(rate)
        self.baudrate = rate

    def hear(self, times: Sequence[int], values: bytes, garbled: Sequence[bool], rate: int) -> None:
        """Bytes from the bus; at a wrong rate they come out as noise."""
        wrong = abs(rate - self.baudrate) > 0.03 * self.baudrate
        heard = [value ^ 0xA5 if wrong else value for value in values]
        if not self.latency:
            self._rx.extend(heard)
            return
        if not self._kept:
            delay = self.latency - self.jitter * self._rng.random()
            self.bus.clock.after(round(delay * SECOND), self._hand_over)
        self._kept += heard
        if len(self._kept) >= CHUNK:
            self._hand_over()

    def _hand_over(self) -> None:
        self._rx.extend(self._kept)
        self._kept.clear()

    def openPort(self) -> bool:
        """Opens; False where it is unplugged."""
        self.is_open = not self.unplugged
        return self.is_open

    def pause(self, seconds: float) -> None:
        """Lets virtual time go by [s]."""
        if seconds > 0:
            self.bus.clock.advance(self.bus.clock.now + round(seconds * SECOND))

    def clearPort(self) -> None:
        """Forgets what came in."""
        self._alive()
        self._rx.clear()

    def writePort(self, packet: Sequence[int]) -> int:
        """Sends now, or after everything written before."""
        self._alive()
        start = max(self.bus.clock.now, self._sending_until)
        self._sending_until = self.bus.talk(self, bytes(packet), self.baudrate, start)
        if self.echo:
            self.bus.clock.at(self._sending_until, partial(self._rx.extend, bytes(packet)))
        return len(packet)

    def readPort(self, length: int) -> bytes:
        """Bytes received so far; if there are none, virtual time advances to the next event, at most a millisecond."""
        self._alive()
        if not self._rx:
            clock = self.bus.clock
            clock.advance(min(max(clock.next_time, clock.now + 1), clock.now + MILLISECOND))
        rx = self._rx
        return bytes([rx.popleft() for _ in range(min(length, len(rx)))]) if rx else b""

    def getBytesAvailable(self) -> int:
        """How many bytes wait."""
        return len(self._rx)

    def getCurrentTime(self) -> float:
        """Virtual milliseconds."""
        return self.bus.clock.now / MILLISECOND

    def _alive(self) -> None:
        if self.unplugged:
            import termios

            raise termios.error(5, "Input/output error")  # what pyserial lets through, on Linux
