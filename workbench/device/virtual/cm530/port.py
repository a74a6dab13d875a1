"""dynamixel-sdk on the PC link of a virtual CM-530: written bytes go to its USART, and time is the board's."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from workbench.device.virtual.clock import MILLISECOND, SECOND
from workbench.device.virtual.cm530.board import Board
from workbench.device.virtual.port import MemoryPort


class PcLinkPort(MemoryPort):
    """The serial port that a PC would have; waiting costs no wall time but the board's. A wrong rate reads as silence."""

    def __init__(self, board: Board) -> None:
        super().__init__("virtual CM-530")
        self.board = board
        self._read = 0
        self.clearPort()
        self.setupPort(57_600)

    def clearPort(self) -> None:
        """Forgets what came in."""
        self._read += self.getBytesAvailable()

    def writePort(self, packet: Sequence[int]) -> int:
        """Sends; time passes until everything is out, as with a blocking port."""
        end = self.board.send(self.board.pc, bytes(packet))
        self.board.run(end)
        return len(packet)

    def readPort(self, length: int) -> bytes:
        """Bytes received so far; if there are none, half a millisecond passes."""
        if self.getBytesAvailable() == 0:
            self.board.run(self.board.clock.now + MILLISECOND // 2)
        length = min(max(length, 0), self.getBytesAvailable())
        data = bytes(self.board.pc.received[self._read:self._read + length])
        self._read += len(data)
        return data

    def getBytesAvailable(self) -> int:
        """How many bytes wait: those whose stop bit is over."""
        return bisect_right(self.board.pc.times, self.board.clock.now) - self._read

    def getCurrentTime(self) -> float:
        """Virtual milliseconds."""
        return self.board.clock.now / MILLISECOND

    def pause(self, seconds: float) -> None:
        """Lets virtual time go by [s]."""
        if seconds > 0:
            self.board.run(self.board.clock.now + round(seconds * SECOND))
