"""The CM-530: processor, peripherals, pins, and the wires to servos, PC and remote."""

from __future__ import annotations

import random
import struct
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

from workbench.device.virtual.bus import ServoBus
from workbench.device.virtual.clock import SECOND, Clock
from workbench.device.virtual.cm530.peripheral import Peripheral
from workbench.device.virtual.cm530.processor import FLASH, FLASH_BYTES, RAM, RAM_BYTES, SYSTICK, BoardError, Processor
from workbench.device.virtual.cm530.system import (
    PIN_RESET,
    POWER_RESET,
    Clocks,
    Converter,
    Core,
    Plain,
    Port,
    Watchdog,
)
from workbench.device.virtual.cm530.usart import Dma, Usart

APPLICATION = 0x08003000
"""Where the loader starts the program."""
START_PIN, TALK_PIN, LISTEN_PIN = 3, 4, 5
_LINE = SECOND * 10 // 57_600
_FIRST_VECTORS = struct.Struct("<II")


@dataclass
class Wire:
    """A serial line of the board as the other end sees it: what came, each byte with the end of its stop bit [ticks]."""

    times: list[int] = field(default_factory=list)
    received: bytearray = field(default_factory=bytearray)
    free_at: int = 0


@dataclass(frozen=True)
class Violation:
    """Forbidden actions of a program: when [ticks], and which."""

    time: int
    what: str


def check_image(image: bytes) -> None:
    """BoardError for bytes that cannot be the image of a program: too many for the flash, or not begun by a table of vectors with
    the stack in memory and the start in the image."""
    room = FLASH + FLASH_BYTES - APPLICATION
    if not _FIRST_VECTORS.size <= len(image) <= room:
        raise BoardError(f"{len(image)} bytes; expected {_FIRST_VECTORS.size} to {room}")
    stack, start = _FIRST_VECTORS.unpack_from(image)
    if not RAM < stack <= RAM + RAM_BYTES or not APPLICATION <= start - 1 < APPLICATION + len(image) or not start & 1:
        raise BoardError(f"its first words are stack {stack:#010x} and start {start:#010x}; expected the image from "
                         "`make firmware`, a .bin file")


class Board:
    """A CM-530 on a servo bus, with `image` at 0x08003000. battery: volts at its own converter.

    violations: bytes sent while the bus was set to receive, peripherals used with their clock off, unknown registers. Switched on
    by `power_on`, then `run`.
    """

    def __init__(self, image: bytes, clock: Clock, bus: ServoBus, seed: int = 0) -> None:
        self.clock, self.bus = clock, bus
        self.battery = 11.1
        self.pc, self.zigbee = Wire(), Wire()
        self.violations: list[Violation] = []
        self.directions: list[tuple[int, bool, bool]] = []
        self.resets: list[tuple[int, int]] = []
        self._rng = random.Random(seed)
        self.cpu = Processor(clock, self._read, self._write, self._pending, self._on_taken)
        self.cpu.uc.mem_write(APPLICATION, image)
        self.clocks, self.core, self.watchdog = Clocks(self), Core(self), Watchdog(self)
        self.ports = {name: Port(self, (0x18, 2 + k)) for k, name in enumerate("ABCD")}
        self.servo_usart = Usart(self, (0x18, 14), True, self._to_servos)
        self.pc_usart = Usart(self, (0x1C, 18), False, lambda d, r, t: self._to_wire(self.pc, d, r, t))
        self.zigbee_usart = Usart(self, (0x1C, 20), False, lambda d, r, t: self._to_wire(self.zigbee, d, r, t))
        self.dma = Dma(self, (0x14, 0))
        self._wire_dma()
        self.peripherals: dict[int, Peripheral] = {
            0x40021000: self.clocks, 0x40022000: Plain(self, None), 0x40010000: Plain(self, (0x18, 0)),
            0x40010800: self.ports["A"], 0x40010C00: self.ports["B"], 0x40011000: self.ports["C"], 0x40011400: self.ports["D"],
            0x40013800: self.servo_usart, 0x40004800: self.pc_usart, 0x40005000: self.zigbee_usart, 0x40020000: self.dma,
            0x40012400: Converter(self, (0x18, 9)), 0x40003000: self.watchdog, 0xE000E000: self.core,
        }
        self._registers = {base + offset: (p, offset) for base, p in self.peripherals.items() for offset in p.known}
        self._interrupts = ((15, lambda: self.dma.waits(5)), (37, self.servo_usart.interrupts), (39, self.pc_usart.interrupts),
                            (53, self.zigbee_usart.interrupts))
        self._on = False
        bus.join(self)

    def _wire_dma(self) -> None:
        channels = self.dma.channels
        channels[2].usart = self.pc_usart
        channels[4].usart = channels[5].usart = self.servo_usart
        self.pc_usart.tx_dma, self.servo_usart.tx_dma = channels[2], channels[4]

    # Power and time

    def power_on(self) -> None:
        """Power comes: memory holds nonsense."""
        self.cpu.uc.mem_write(RAM, self._rng.randbytes(RAM_BYTES))
        self._on = True
        self._restart(POWER_RESET | PIN_RESET)

    def power_off(self) -> None:
        """Power goes."""
        self._on = False
        self.bus.silence(self)
        for peripheral in self.peripherals.values():
            peripheral.reset()
        self.cpu.stop()

    def reset(self, cause: int = PIN_RESET) -> None:
        """A reset that leaves memory as it is; cause: flags of RCC_CSR."""
        self.cpu.stop()
        self._restart(cause)

    def _restart(self, cause: int) -> None:
        self.resets.append((self.clock.now, cause))
        self.bus.silence(self)
        for peripheral in self.peripherals.values():
            peripheral.reset()
        self.clocks.causes |= cause
        self.cpu.vectors = APPLICATION
        self.cpu.reset(APPLICATION)

    def run(self, until: int) -> None:
        """Lets everything happen until a time [ticks]."""
        if self._on:
            self.cpu.run(until)
        else:
            self.clock.advance(until)

    # Registers

    def clocks_changed(self) -> None:
        """Which peripherals have a clock now."""
        for peripheral in self.peripherals.values():
            gate = peripheral.gate
            peripheral.clocked = gate is None or bool(self.clocks.words[gate[0]] >> gate[1] & 1)

    def _register(self, address: int) -> tuple[Peripheral, int]:
        found = self._registers.get(address)
        if found is None:
            raise BoardError(f"no such register: {address:#010x}")
        if not found[0].clocked:
            self._record_violation(f"register {address:#010x} used while its clock is off")
        return found

    def _read(self, address: int) -> int:
        peripheral, offset = self._register(address)
        return peripheral.read(offset) if peripheral.clocked else 0

    def _write(self, address: int, size: int, value: int) -> None:
        peripheral, offset = self._register(address)
        if size != 4:
            raise BoardError(f"{size} bytes written to {address:#010x}; this board takes words")
        if peripheral.clocked:
            peripheral.write(offset, value)

    def _pending(self) -> int | None:
        if self.core.tick_waits:
            return SYSTICK
        for irq, waits in self._interrupts:
            if waits() and self.core.is_enabled(irq):
                return 16 + irq
        return None

    def _on_taken(self, number: int) -> None:
        if number == SYSTICK:
            self.core.tick_waits = False

    def _record_violation(self, what: str) -> None:
        self.violations.append(Violation(self.clock.now, what))

    # Pins

    def press_start(self, down: bool) -> None:
        """The START button."""
        port = self.ports["B"]
        port.inputs = port.inputs & ~(1 << START_PIN) if down else port.inputs | 1 << START_PIN

    def pins_changed(self, port: Port) -> None:
        """Direction of the servo bus: exactly one of two, and none changes while bytes are under way."""
        if port is not self.ports["B"]:
            return
        now = (port.drives(TALK_PIN), port.drives(LISTEN_PIN))
        if self.directions and self.directions[-1][1:] == now:
            return
        self.directions.append((self.clock.now, *now))
        if self.servo_usart.sending:
            self._record_violation("the servo bus was turned while bytes were under way")

    # Wires

    def _to_servos(self, data: bytes, rate: int, start: int) -> None:
        port = self.ports["B"]
        if not port.drives(TALK_PIN) or port.drives(LISTEN_PIN):
            self._record_violation(f"{len(data)} bytes sent while the bus was set to receive")
            return
        if port.mode(6) & 3 == 0 or not self.peripherals[0x40010000].read(4) & 4:
            self._record_violation("bytes sent with USART1 not on pin PB6")
            return
        self.bus.talk(self, data, rate, start)

    def hear(self, times: Sequence[int], values: bytes, garbled: Sequence[bool], rate: int) -> None:
        """Bytes on the servo bus."""
        port, usart = self.ports["B"], self.servo_usart
        if not self._on or not port.drives(LISTEN_PIN):
            return
        wrong = abs(rate - usart.rate) > 0.03 * usart.rate
        data = bytes(value ^ 0xA5 for value in values) if wrong else values
        channel = self.dma.channels[5]
        early = bisect_right(times, channel.armed)
        taken = early + channel.take(data[early:]) if usart.takes_dma else early
        for late, value in enumerate(data[:early]):  # nobody asked: spaced, so that none overruns the next
            self.clock.after(late * usart.byte, partial(usart.receive, value))
        for late, value in enumerate(data[taken:], start=1):
            self.clock.after(late * usart.byte, partial(self._heard_late, value))

    def _heard_late(self, value: int) -> None:
        """A byte beyond the DMA's first request: it may have been extended by now; else nobody asked."""
        if not (self.servo_usart.takes_dma and self.dma.channels[5].take(bytes([value]))):
            self.servo_usart.receive(value)

    def _to_wire(self, wire: Wire, data: bytes, rate: int, start: int) -> None:
        byte = 10 * SECOND // rate
        wire.times += range(start + byte, start + byte * len(data) + 1, byte)
        wire.received += data

    def send(self, wire: Wire, data: bytes, at: int | None = None) -> int:
        """The other end of a line sends at 57,600 bit/s, from `at` [ticks] or when it is free. Returns the last byte's end."""
        usart = self.pc_usart if wire is self.pc else self.zigbee_usart
        time = max(self.clock.now if at is None else at, wire.free_at)
        for value in data:
            time += _LINE
            self.clock.at(time, lambda v=value: usart.receive(v))  # type: ignore[misc]
        wire.free_at = time
        return time


__all__ = ["APPLICATION", "FLASH", "Board", "Violation", "Wire"]
