"""Clocks and resets, SysTick, interrupt controller, watchdog, converter, pins, flash and alternate functions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workbench.device.virtual.clock import MICROSECOND, SECOND
from workbench.device.virtual.cm530.peripheral import Peripheral

if TYPE_CHECKING:
    from workbench.device.virtual.cm530.board import Board

PIN_RESET, POWER_RESET, SOFTWARE_RESET, WATCHDOG_RESET = 1 << 26, 1 << 27, 1 << 28, 1 << 29
"""Flags of RCC_CSR."""
INTERNAL_HERTZ = 8_000_000
"""Of the internal oscillator, and of the crystal."""


class Clocks(Peripheral):
    """RCC: oscillators are ready at once, the selected one is the one that runs. hertz: of the processor; slow_hertz: of APB1."""

    known = frozenset(range(0, 0x28, 4))

    def __init__(self, board: Board) -> None:
        super().__init__(board, None)
        self.causes = 0
        self.hertz = self.slow_hertz = INTERNAL_HERTZ

    def reset(self) -> None:
        """Closes all gates and selects the internal oscillator."""
        super().reset()
        self.words[0] = 0x83
        self._set_clocks()

    def read(self, offset: int) -> int:
        """Ready bits follow the on bits; CSR tells what reset there was."""
        value = super().read(offset)
        if offset == 0x00:
            return value | (value & 1) << 1 | (value & 1 << 16) << 1 | (value & 1 << 24) << 1
        if offset == 0x04:
            return value & ~12 | (value & 3) << 2
        return value | self.causes if offset == 0x24 else value

    def write(self, offset: int, value: int) -> None:
        """RMVF forgets the causes."""
        if offset == 0x24:
            if value & 1 << 24:
                self.causes = 0
            value &= 1
        super().write(offset, value)
        self._set_clocks()

    def _set_clocks(self) -> None:
        """What runs, and how fast, as far as the program has set it up."""
        control, config = self.words[0], self.words[4]
        on_pll = config & 3 == 2 and control & 1 << 24 and control & 1 << 16
        self.hertz = INTERNAL_HERTZ * ((config >> 18 & 15) + 2) if on_pll and config & 1 << 16 else INTERNAL_HERTZ
        prescaler = config >> 8 & 7
        self.slow_hertz = self.hertz >> (prescaler - 3 if prescaler > 3 else 0)
        self.board.clocks_changed()


class Core(Peripheral):
    """SysTick and interrupt controller at 0xE000E000; VTOR."""

    known = frozenset((0x10, 0x14, 0x18, 0x100, 0x104, 0x180, 0x184, 0x280, 0x284, 0xD08))

    def __init__(self, board: Board) -> None:
        super().__init__(board, None)
        self.tick_waits = False
        self._generation = 0
        self._due = 0

    def reset(self) -> None:
        """Off, all interrupts disabled."""
        super().reset()
        self.tick_waits = False
        self._generation += 1

    def is_enabled(self, irq: int) -> bool:
        """Whether an interrupt is let through."""
        return bool(self.words[0x104 if irq > 31 else 0x100] >> irq % 32 & 1)

    def write(self, offset: int, value: int) -> None:
        """Set-enable registers only set, clear-enable ones only clear."""
        if offset in (0x180, 0x184):
            self.words[offset - 0x80] = self.read(offset - 0x80) & ~value
            return
        if offset in (0x100, 0x104):
            value |= self.read(offset)
        super().write(offset, value)
        if offset == 0x10:
            self._generation += 1
            self._due = self.board.clock.now
            if value & 1:
                self._next(self._generation)
        if offset == 0xD08:
            self.board.cpu.vectors = value

    def _next(self, generation: int) -> None:
        cycles = (self.read(0x14) + 1) * (1 if self.read(0x10) & 4 else 8)
        self._due += cycles * SECOND // self.board.clocks.hertz
        self.board.clock.at(self._due, lambda: self._tick(generation))

    def _tick(self, generation: int) -> None:
        if generation != self._generation:
            return
        self._next(generation)
        if self.read(0x10) & 2:
            self.tick_waits = True
            self.board.cpu.wish()


class Watchdog(Peripheral):
    """IWDG, of 40 kHz; once started it never stops."""

    known = frozenset((0, 4, 8))

    def __init__(self, board: Board) -> None:
        super().__init__(board, None)
        self.started = False
        self._fed = 0

    def reset(self) -> None:
        """Off."""
        super().reset()
        self.words[8] = 0xFFF
        self.started = False
        self._fed += 1

    def write(self, offset: int, value: int) -> None:
        """0x5555 unlocks, 0xAAAA feeds, 0xCCCC starts."""
        if offset != 0:
            if self.words[0] == 0x5555:
                self.words[offset] = value
            return
        if value != 0xAAAA or not self.started:
            self.words[0] = value
        self.started = self.started or value == 0xCCCC
        if value in (0xAAAA, 0xCCCC) and self.started:
            self._fed += 1
            fed = self._fed
            wait = (self.words[8] + 1) * (4 << self.words[4]) * SECOND // 40_000
            self.board.clock.after(wait, lambda: self._reset_if_starved(fed))

    def _reset_if_starved(self, fed: int) -> None:
        if self.started and fed == self._fed:
            self.board.reset(WATCHDOG_RESET)


class Converter(Peripheral):
    """ADC1: one conversion at a time of channel 13, the battery."""

    known = frozenset((0x00, 0x08, 0x0C, 0x34, 0x4C))

    def write(self, offset: int, value: int) -> None:
        """SWSTART converts in 21 microseconds."""
        if offset == 8 and value & 1 << 22 and value & 1 and self.read(0x34) & 31 == 13:
            value &= ~(1 << 22)
            self.board.clock.after(21 * MICROSECOND, self._finish_conversion)
        super().write(offset, value)

    def _finish_conversion(self) -> None:
        self.words[0x4C] = min(round(160 * self.board.battery), 4095)
        self.words[0] |= 2

    def read(self, offset: int) -> int:
        """Reading the result takes its flag away."""
        value = super().read(offset)
        if offset == 0x4C:
            self.words[0] &= ~2
        return value


class Port(Peripheral):
    """Sixteen pins; `inputs` are their external levels."""

    known = frozenset((0x00, 0x04, 0x08, 0x0C, 0x10))

    def __init__(self, board: Board, gate: tuple[int, int]) -> None:
        super().__init__(board, gate)
        self.inputs = 0xFFFF
        self._outputs = 0

    def reset(self) -> None:
        """Makes all pins inputs."""
        super().reset()
        self.words[0] = self.words[4] = 0x44444444
        self._outputs = 0

    def read(self, offset: int) -> int:
        """IDR: the world on inputs, ourselves on outputs."""
        if offset != 8:
            return super().read(offset)
        return (self.output & self._outputs) | (self.inputs & ~self._outputs & 0xFFFF)

    def write(self, offset: int, value: int) -> None:
        """BSRR sets and clears; the board examines the changes."""
        before = self.output
        if offset == 0x10:
            value = (before | value & 0xFFFF) & ~(value >> 16)
            offset = 0x0C
        self.words[offset] = value
        if offset < 8:
            self._outputs = sum(1 << pin for pin in range(16) if self.mode(pin) & 3)
        self.board.pins_changed(self)

    @property
    def output(self) -> int:
        """ODR."""
        return self.words[0x0C]

    def mode(self, pin: int) -> int:
        """Four bits of configuration."""
        return self.words[4 * (pin // 8)] >> 4 * (pin % 8) & 15

    def drives(self, pin: int) -> bool:
        """An output that is high."""
        return bool((self._outputs & self.words[0x0C]) >> pin & 1)


class Plain(Peripheral):
    """Flash control or alternate functions: plain read-write words."""

    known = frozenset((0, 4))
