"""USARTs with byte times, and the DMA channels that serve them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from workbench.device.virtual.clock import SECOND
from workbench.device.virtual.cm530.peripheral import Peripheral

if TYPE_CHECKING:
    from workbench.device.virtual.cm530.board import Board

SR, DR, BRR, CR1, CR2, CR3 = 0x00, 0x04, 0x08, 0x0C, 0x10, 0x14
ORE, RXNE, TC, TXE = 1 << 3, 1 << 5, 1 << 6, 1 << 7
RE, TE, RXNEIE, TCIE, TXEIE, UE = 1 << 2, 1 << 3, 1 << 5, 1 << 6, 1 << 7, 1 << 13
DMAR, DMAT = 1 << 6, 1 << 7


class Usart(Peripheral):
    """One USART. `sends` takes (bytes, bit rate, start [ticks]) and puts them on the wire."""

    known = frozenset((SR, DR, BRR, CR1, CR2, CR3))

    def __init__(self, board: Board, gate: tuple[int, int], fast: bool, sends: Callable[[bytes, int, int], None]) -> None:
        super().__init__(board, gate)
        self._fast, self._sends = fast, sends
        self.tx_dma: Channel | None = None
        self._hold: int | None = None
        self._shifting_until = -1
        self._received = 0
        self._epoch = 0

    def reset(self) -> None:
        """Off, nothing under way."""
        super().reset()
        self.words[SR] = TC | TXE
        self._hold = None
        self._shifting_until = -1
        self._epoch += 1

    @property
    def rate(self) -> int:
        """bit/s."""
        clocks = self.board.clocks
        return (clocks.hertz if self._fast else clocks.slow_hertz) // max(self.words[BRR], 1)

    @property
    def byte(self) -> int:
        """Duration of a byte [ticks]."""
        return 10 * SECOND // self.rate

    def read(self, offset: int) -> int:
        """Reading DR takes RXNE and ORE away."""
        if offset != DR:
            return self.words[offset]
        self.words[SR] &= ~(RXNE | ORE)
        return self._received

    def write(self, offset: int, value: int) -> None:
        """DR sends; SR's TC and RXNE can only be cleared."""
        if offset == DR:
            self._send(value & 0xFF)
        elif offset == SR:
            self.words[SR] &= value | ~(TC | RXNE)
        else:
            self.words[offset] = value
        if offset in (CR1, CR3, SR):
            if self.tx_dma is not None:
                self.tx_dma.serve()
            self.board.cpu.wish()

    def interrupts(self) -> bool:
        """TC, TXE and RXNE (or ORE), each if enabled."""
        control, status = self.words[CR1], self.words[SR]  # each flag and what enables it are the same bit
        return bool(control & status & (TC | TXE | RXNE) or (control & RXNEIE and status & ORE))

    def _send(self, value: int) -> None:
        if self.words[CR1] & (UE | TE) != UE | TE:
            return
        self.words[SR] &= ~TC
        if self._shifting_until > self.board.clock.now:
            self._hold = value
            self.words[SR] &= ~TXE
            return
        self._shift(value)

    def _shift(self, value: int) -> None:
        now = self.board.clock.now
        self._shifting_until = now + self.byte
        self._sends(bytes([value]), self.rate, now)
        epoch = self._epoch
        self.board.clock.at(self._shifting_until, lambda: self._finish_shift(epoch))

    def _finish_shift(self, epoch: int) -> None:
        if epoch != self._epoch:
            return
        if self._hold is not None:
            value, self._hold = self._hold, None
            self._shift(value)
            self.words[SR] |= TXE
        else:
            self.words[SR] |= TC | TXE
        self.board.cpu.wish()

    def send_block(self, data: bytes, ended: Callable[[], None]) -> None:
        """What DMA brings: back to back from now."""
        start = max(self.board.clock.now, self._shifting_until)
        self._shifting_until = start + self.byte * len(data)
        self.words[SR] &= ~TC
        self._sends(data, self.rate, start)
        epoch = self._epoch

        def finish_block() -> None:
            if epoch != self._epoch:
                return
            self.words[SR] |= TC | TXE
            ended()
            self.board.cpu.wish()

        self.board.clock.at(self._shifting_until, finish_block)

    @property
    def sending(self) -> bool:
        """Whether bytes are under way."""
        return self._shifting_until > self.board.clock.now

    @property
    def takes_dma(self) -> bool:
        """Whether received bytes go to memory by DMA."""
        return bool(self.words[CR1] & (UE | RE) == UE | RE and self.words[CR3] & DMAR)

    def receive(self, value: int) -> None:
        """Receives one byte."""
        if self.words[CR1] & (UE | RE) != UE | RE:
            return
        if self.words[SR] & RXNE:
            self.words[SR] |= ORE
        else:
            self._received = value
            self.words[SR] |= RXNE
        self.board.cpu.wish()


class Dma(Peripheral):
    """DMA1: channels 2 (USART3 out), 4 and 5 (USART1 out and in)."""

    known = frozenset({0, 4} | {0x08 + 20 * (k - 1) + 4 * w for k in (2, 4, 5) for w in range(4)})

    def __init__(self, board: Board, gate: tuple[int, int]) -> None:
        super().__init__(board, gate)
        self.channels = {k: Channel(self, k) for k in (2, 4, 5)}
        self._by_control = {channel.base: channel for channel in self.channels.values()}

    def read(self, offset: int) -> int:
        """Counters are as of now."""
        if offset == 0x08 + 20 * 4 + 4:
            self.board.bus.settle()
        return self.words[offset]

    def write(self, offset: int, value: int) -> None:
        """IFCR clears flags; an enabled channel starts."""
        if offset == 4:
            for k in range(7):
                if value >> 4 * k & 1:
                    self.words[0] &= ~(15 << 4 * k)
            self.words[0] &= ~value
            return
        channel = self._by_control.get(offset)
        if channel is None:
            self.words[offset] = value
            return
        self.board.bus.settle()
        self.words[offset] = value
        channel.armed = self.board.clock.now
        channel.serve()

    def finish(self, channel: int) -> None:
        """Transfer complete."""
        self.words[0] |= 3 << 4 * (channel - 1)
        self.board.cpu.wish()

    def waits(self, channel: int) -> bool:
        """Whether the channel's interrupt line is up."""
        return bool(self.words[0] >> 4 * (channel - 1) & 2 and self.channels[channel].control & 2)


class Channel:
    """One DMA channel; its words live in the controller's."""

    def __init__(self, dma: Dma, number: int) -> None:
        self.dma, self.number = dma, number
        self.base = 0x08 + 20 * (number - 1)
        self.usart: Usart | None = None
        self.armed = 0
        self._under_way = False
        self._taken = 0

    @property
    def control(self) -> int:
        """CCR."""
        return self.dma.words[self.base]

    def serve(self) -> None:
        """Memory to USART: starts once channel and USART are both enabled."""
        usart, words = self.usart, self.dma.words
        control = words[self.base]
        if not control & 1:
            self._under_way = False
            self._taken = 0
            return
        if usart is None or self._under_way or not control & 16 or not words[self.base + 4]:
            return
        if usart.words[CR1] & (UE | TE) != UE | TE or not usart.words[CR3] & DMAT:
            return
        self._under_way = True
        count = words[self.base + 4]
        words[self.base + 4] = 0
        data = self.dma.board.cpu.engine.peek(words[self.base + 12], count)
        usart.send_block(data, lambda: self.dma.finish(self.number))

    def take(self, data: bytes) -> int:
        """USART to memory; returns how many bytes the channel still wanted."""
        words = self.dma.words
        left = words[self.base + 4]
        if not self.control & 1 or self.control & 16 or not left or not data:
            return 0
        count = min(left, len(data))
        words[self.base + 4] = left - count
        self.dma.board.cpu.engine.poke(words[self.base + 12] + self._taken, data[:count])
        self._taken += count
        if left == count:
            self.dma.finish(self.number)
        return count
