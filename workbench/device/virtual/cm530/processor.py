"""A Cortex-M3 in unicorn under the virtual clock: instructions, exceptions, sleep."""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any

import unicorn
from unicorn import arm_const as arm

from workbench.device.virtual.clock import Clock
from workbench.device.virtual.cm530.cycles import NEVER, Cycles, Registers

FLASH, FLASH_BYTES, RAM, RAM_BYTES = 0x08000000, 0x80000, 0x20000000, 0x10000
PERIPHERALS, PERIPHERALS_BYTES, SYSTEM, SYSTEM_BYTES = 0x40000000, 0x30000, 0xE000E000, 0x1000
ENTRY_CYCLES = 12
HARD_FAULT, SYSTICK = 3, 15
_EXCEPTION_EXIT = 8
_WFI = b"\x30\xbf"
_STACKED = (arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3, arm.UC_ARM_REG_R12, arm.UC_ARM_REG_LR)


class BoardError(RuntimeError):
    """The program did what the real chip would not survive, or what this board does not know."""


class Processor:
    """Runs code between events. `read` and `write` are the board's registers, `pending` the next exception that waits,
    or None; `taken` hears which is entered."""

    def __init__(self, clock: Clock, read: Callable[[int], int], write: Callable[[int, int, int], None],
                 pending: Callable[[], int | None], taken: Callable[[int], None]) -> None:
        self.clock = clock
        self.vectors = FLASH
        self.faults: list[str] = []
        self._pending, self._taken = pending, taken
        self._active: list[int] = []
        self._pc = 0
        self._asleep = False
        self._exit: int | None = None
        self.cycles = Cycles()
        self._error: BaseException | None = None
        self.uc = uc = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        uc.ctl_set_cpu_model(arm.UC_CPU_ARM_CORTEX_M3)
        uc.mem_map(FLASH, FLASH_BYTES)
        uc.mem_map(RAM, RAM_BYTES)
        for base, size in ((PERIPHERALS, PERIPHERALS_BYTES), (SYSTEM, SYSTEM_BYTES)):
            uc.mmio_map(base, size, self._guarded_read(read), base, self._guarded_write(write), base)
        self.cycles.attach(uc)
        self._frame = Registers(uc, (*_STACKED, arm.UC_ARM_REG_SP, arm.UC_ARM_REG_XPSR))
        uc.hook_add(unicorn.UC_HOOK_INTR, self._interrupted)

    def reset(self, vectors: int) -> None:
        """Starts at the reset vector of a table."""
        stack, start = struct.unpack("<II", self.uc.mem_read(vectors, 8))
        for register in (*_STACKED, arm.UC_ARM_REG_R4, arm.UC_ARM_REG_R5, arm.UC_ARM_REG_R6, arm.UC_ARM_REG_R7):
            self.uc.reg_write(register, 0)
        self.uc.reg_write(arm.UC_ARM_REG_PRIMASK, 0)
        self.uc.reg_write(arm.UC_ARM_REG_SP, stack)
        self._pc = start | 1
        self._active.clear()
        self._asleep = False

    def wish(self) -> None:
        """Some exception may wait now: the code is stopped at its next block (stopped within an access, it would repeat that)."""
        self.cycles.wish = 1

    def stop(self) -> None:
        """Stops the code that runs, as for a reset."""
        self._exit = -1
        self.uc.emu_stop()

    def run(self, until: int) -> None:
        """Lets the processor run, or sleep, until a time [ticks]."""
        clock = self.clock
        while clock.now < until:
            clock.advance(clock.now)
            number = None if self._active else self._pending()
            if number is not None:
                self._asleep = False
                if not self.uc.reg_read(arm.UC_ARM_REG_PRIMASK):
                    self._taken(number)
                    self._enter(number)
                    number = None
            if self._asleep:
                event = clock.next_event
                clock.advance(until if event is None else min(event, until))
                continue
            self.cycles.wish = number is not None and not self._active  # masked: look again at every block
            self._go()

    def _go(self) -> None:
        uc, cycles = self.uc, self.cycles
        self._exit = None
        cycles.now = self.clock.now
        event = self.clock.next_event
        cycles.limit = NEVER if event is None else event
        try:
            try:
                uc.emu_start(self._pc, 0xFFFFFFFF)
            finally:
                self.clock.now = cycles.now
        except unicorn.UcError as e:
            self._raise()
            at = uc.reg_read(arm.UC_ARM_REG_PC)
            if at >= 0xFFFFFFF0:
                self._leave()
                return
            self._hard_fault(f"{e} at {at:#010x}")
            return
        self._raise()
        if self._exit == -1:
            return  # reset: the program counter is a new one
        if self._exit is not None:
            if self._exit == _EXCEPTION_EXIT:
                self._leave()
            else:
                self._hard_fault(f"exception {self._exit} of the processor at {uc.reg_read(arm.UC_ARM_REG_PC):#010x}")
            return
        pc = uc.reg_read(arm.UC_ARM_REG_PC)
        self._pc = pc | 1
        if bytes(uc.mem_read(pc - 2, 2)) == _WFI and self._pending() is None:
            self._asleep = True

    def _look(self) -> None:
        """After an access: it may have asked for an event that is sooner than any before."""
        event = self.clock.next_event
        if event is not None:
            self.cycles.limit = event

    def _interrupted(self, uc: unicorn.Uc, number: int, _: Any) -> None:
        self._exit = number
        uc.emu_stop()

    def _enter(self, number: int) -> None:
        uc = self.uc
        *registers, sp, xpsr = self._frame.read()
        uc.mem_write(sp - 32, struct.pack("<8I", *registers, self._pc & ~1, xpsr & 0xFF000000 | 1 << 24))
        registers[-1] = 0xFFFFFFF9
        self._frame.write([*registers, sp - 32, xpsr])
        self._pc = struct.unpack("<I", uc.mem_read(self.vectors + 4 * number, 4))[0] | 1
        self._active.append(number)
        self.clock.now += ENTRY_CYCLES

    def _leave(self) -> None:
        uc = self.uc
        sp = uc.reg_read(arm.UC_ARM_REG_SP)
        *registers, pc, xpsr = struct.unpack("<8I", uc.mem_read(sp, 32))
        self._frame.write([*registers, sp + 32, xpsr])
        self._pc = pc | 1
        self._active.pop()
        self.clock.now += ENTRY_CYCLES

    def _hard_fault(self, what: str) -> None:
        self.faults.append(what)
        self._enter(HARD_FAULT)

    def _raise(self) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def _guarded_read(self, read: Callable[[int], int]) -> Callable[..., int]:
        def call(uc: unicorn.Uc, offset: int, size: int, base: int) -> int:
            try:
                self.clock.now = self.cycles.now
                value = read(base + offset)
                self._look()
                return value
            except Exception as e:  # raised again where Python code runs, not in the engine's callback
                self._error = e
                uc.emu_stop()
                return 0

        return call

    def _guarded_write(self, write: Callable[[int, int, int], None]) -> Callable[..., None]:
        def call(uc: unicorn.Uc, offset: int, size: int, value: int, base: int) -> None:
            try:
                self.clock.now = self.cycles.now
                write(base + offset, size, value)
                self._look()
            except Exception as e:
                self._error = e
                uc.emu_stop()

        return call
