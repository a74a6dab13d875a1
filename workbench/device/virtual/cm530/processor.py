"""A Cortex-M3 in unicorn under the virtual clock: instructions, exceptions, sleep."""

from __future__ import annotations

import struct
from collections.abc import Callable

import unicorn
from unicorn import arm_const as arm

from workbench.device.virtual.clock import Clock
from workbench.device.virtual.cm530.cycles import Cycles
from workbench.device.virtual.cm530.engine import Engine, Registers

FLASH, FLASH_BYTES, RAM, RAM_BYTES = 0x08000000, 0x80000, 0x20000000, 0x10000
PERIPHERALS, PERIPHERALS_BYTES, SYSTEM, SYSTEM_BYTES = 0x40000000, 0x30000, 0xE000E000, 0x1000
ENTRY_CYCLES = 12
HARD_FAULT, SYSTICK = 3, 15
_EXCEPTION_EXIT = 8
_RETURN = 0xFFFFFFF0
_WFI = b"\x30\xbf"
_FRAME = struct.Struct("<8I")
_STACKED = (arm.UC_ARM_REG_R0, arm.UC_ARM_REG_R1, arm.UC_ARM_REG_R2, arm.UC_ARM_REG_R3, arm.UC_ARM_REG_R12, arm.UC_ARM_REG_LR)


class BoardError(RuntimeError):
    """The program did something that the real chip would not survive, or that this board does not support."""


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
        self._masked = False
        self._asleep = False
        self._exit: int | None = None
        self.cycles = Cycles()
        self._error: BaseException | None = None
        self.uc = uc = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        uc.ctl_set_cpu_model(arm.UC_CPU_ARM_CORTEX_M3)
        self.engine = engine = Engine(uc)
        uc.mem_map(FLASH, FLASH_BYTES)
        uc.mem_map(RAM, RAM_BYTES)
        for base, size in ((PERIPHERALS, PERIPHERALS_BYTES), (SYSTEM, SYSTEM_BYTES)):
            engine.map_registers(base, size, self._guarded_read(read), self._guarded_write(write))
        self.cycles.attach(uc)
        self._frame = Registers(uc, (*_STACKED, arm.UC_ARM_REG_SP, arm.UC_ARM_REG_XPSR))
        self._place = Registers(uc, (arm.UC_ARM_REG_PC, arm.UC_ARM_REG_PRIMASK, arm.UC_ARM_REG_SP))
        self._sleeps: dict[int, bool] = {}
        engine.on_interrupt(self._leave_interrupt)

    def reset(self, vectors: int) -> None:
        """Starts at the reset vector of a table."""
        stack, start = struct.unpack("<II", self.uc.mem_read(vectors, 8))
        for register in (*_STACKED, arm.UC_ARM_REG_R4, arm.UC_ARM_REG_R5, arm.UC_ARM_REG_R6, arm.UC_ARM_REG_R7):
            self.uc.reg_write(register, 0)
        self.uc.reg_write(arm.UC_ARM_REG_PRIMASK, 0)
        self.uc.reg_write(arm.UC_ARM_REG_SP, stack)
        self._pc = start | 1
        self._active.clear()
        self._asleep = self._masked = False
        self._sleeps.clear()

    def wish(self) -> None:
        """Some exception may wait now: if so, the code is stopped at its next block (within an access, it would repeat that)."""
        if not self._active and self._pending() is not None:
            self.cycles.wish = 1

    def stop(self) -> None:
        """Stops the code that runs, as for a reset."""
        self._exit = -1
        self.uc.emu_stop()

    def run(self, until: int) -> None:
        """Lets the processor run, or sleep, until a time [ticks]. BoardError where it locks up, as on a fault within a fault."""
        try:
            self._run(until)
        except unicorn.UcError as e:
            first = f"; before that {self.faults[0]}" if self.faults else ""
            raise BoardError(f"the processor locked up at {self._pc & ~1:#010x} ({e}{first})") from None

    def _run(self, until: int) -> None:
        clock = self.clock
        while clock.now < until:
            if clock.next_time <= clock.now:
                clock.advance(clock.now)
            number = None if self._active else self._pending()
            if number is not None:
                self._asleep = False
                if not self._masked:
                    self._taken(number)
                    self._enter(number)
                    number = None
            if self._asleep:
                clock.advance(min(clock.next_time, until))
                continue
            self.cycles.wish = number is not None and not self._active  # masked: look again at every block
            self._go()

    def _go(self) -> None:
        cycles, clock = self.cycles, self.clock
        self._exit = None
        cycles.now = clock.now
        cycles.limit = clock.next_time
        status = self.engine.start(self._pc)
        clock.now = cycles.now
        if self._error is not None:
            error, self._error = self._error, None
            raise error
        if self._exit == -1:
            return  # reset: the program counter is a new one
        pc, masked, sp = self._place.read()
        self._masked = bool(masked)
        if self._exit == _EXCEPTION_EXIT or (status and pc >= _RETURN):
            self._leave(sp)
        elif self._exit is not None:
            self._hard_fault(f"exception {self._exit} of the processor at {pc:#010x}")
        elif status:
            self._hard_fault(f"{unicorn.UcError(status)} at {pc:#010x}")
        else:
            self._pc = pc | 1
            self._asleep = self._after_wfi(pc) and self._pending() is None

    def _after_wfi(self, pc: int) -> bool:
        known = self._sleeps.get(pc)
        if known is None:
            known = self._sleeps[pc] = self.engine.peek(pc - 2, 2) == _WFI
        return known

    def _leave_interrupt(self, number: int) -> None:
        self._exit = number
        self.engine.stop()

    def _enter(self, number: int) -> None:
        *registers, sp, xpsr = self._frame.read()
        self.engine.poke(sp - 32, _FRAME.pack(*registers, self._pc & ~1, xpsr & 0xFF000000 | 1 << 24))
        registers[-1] = 0xFFFFFFF9
        self._frame.write([*registers, sp - 32, xpsr])
        self._pc = int.from_bytes(self.engine.peek(self.vectors + 4 * number, 4), "little") | 1
        self._active.append(number)
        self.clock.now += ENTRY_CYCLES

    def _leave(self, sp: int) -> None:
        *registers, pc, xpsr = _FRAME.unpack(self.engine.peek(sp, 32))
        self._frame.write([*registers, sp + 32, xpsr])
        self._pc = pc | 1
        self._active.pop()
        self.clock.now += ENTRY_CYCLES

    def _hard_fault(self, what: str) -> None:
        self.faults.append(what)
        self._enter(HARD_FAULT)

    def _guarded_read(self, read: Callable[[int], int]) -> Callable[[int], int]:
        clock, cycles = self.clock, self.cycles

        def call(address: int) -> int:
            try:
                clock.now = cycles.now
                value = read(address)
                cycles.limit = clock.next_time  # it may have asked for an event that is sooner than any before
            except Exception as e:  # raised again where Python code runs, not in the engine's callback
                self._fail(e)
                return 0
            return value

        return call

    def _guarded_write(self, write: Callable[[int, int, int], None]) -> Callable[[int, int, int], None]:
        clock, cycles = self.clock, self.cycles

        def call(address: int, size: int, value: int) -> None:
            try:
                clock.now = cycles.now
                write(address, size, value)
                cycles.limit = clock.next_time
            except Exception as e:
                self._fail(e)

        return call

    def _fail(self, error: Exception) -> None:
        self._error = error
        self.engine.stop()
