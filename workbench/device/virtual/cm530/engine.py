"""Unicorn's calls that are made thousands of times in a second of the robot, without the layers of its own Python package."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import unicorn
from unicorn.unicorn_py3.unicorn import uclib

NOWHERE = 0xFFFFFFFF
"""Where no code is: the engine runs until it is stopped."""
_READ = ctypes.CFUNCTYPE(ctypes.c_uint64, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint, ctypes.c_void_p)
_WRITE = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint, ctypes.c_uint64, ctypes.c_void_p)
_INTERRUPT = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_void_p)


class Engine:
    """One unicorn engine. Callbacks must not raise."""

    def __init__(self, uc: unicorn.Uc) -> None:
        self.uc = uc
        self._handle = uc._uch
        self._kept: list[object] = []

    def start(self, pc: int) -> int:
        """Runs from `pc` until something stops it; the engine's error code, 0 for none."""
        return uclib.uc_emu_start(self._handle, pc, NOWHERE, 0, 0)  # type: ignore[no-any-return]

    def stop(self) -> None:
        """Stops it, from within a callback."""
        uclib.uc_emu_stop(self._handle)

    def peek(self, address: int, size: int) -> bytes:
        """Memory."""
        data = ctypes.create_string_buffer(size)
        _check(uclib.uc_mem_read(self._handle, address, data, size))
        return data.raw

    def poke(self, address: int, data: bytes) -> None:
        """Sets memory."""
        _check(uclib.uc_mem_write(self._handle, address, data, len(data)))

    def map_registers(self, base: int, size: int, read: Callable[[int], int], write: Callable[[int, int, int], None]) -> None:
        """Has reads (address) and writes (address, bytes, value) of these addresses called."""
        calls = (_READ(lambda _, offset, size, __: read(base + offset)),
                 _WRITE(lambda _, offset, size, value, __: write(base + offset, size, value)))
        self._kept += calls
        _check(uclib.uc_mmio_map(self._handle, base, size, ctypes.cast(calls[0], ctypes.c_void_p), None,
                                 ctypes.cast(calls[1], ctypes.c_void_p), None))

    def on_interrupt(self, call: Callable[[int], None]) -> None:
        """Has `call` called with the number of an exception of the processor."""
        hook = _INTERRUPT(lambda _, number, __: call(number))
        self._kept.append(hook)
        handle = ctypes.c_size_t()
        _check(uclib.uc_hook_add(self._handle, ctypes.byref(handle), unicorn.UC_HOOK_INTR, ctypes.cast(hook, ctypes.c_void_p),
                                 None, ctypes.c_uint64(1), ctypes.c_uint64(0)))


class Registers:
    """Several registers read or written in one call."""

    def __init__(self, uc: unicorn.Uc, numbers: tuple[int, ...]) -> None:
        self._handle, self._count = uc._uch, len(numbers)
        self._numbers = (ctypes.c_int * len(numbers))(*numbers)
        self._values = (ctypes.c_uint64 * len(numbers))()
        size = ctypes.sizeof(ctypes.c_uint64)
        self._places = (ctypes.c_void_p * len(numbers))(*(ctypes.addressof(self._values) + size * k for k in range(len(numbers))))

    def read(self) -> list[int]:
        """Values of registers, in order."""
        uclib.uc_reg_read_batch(self._handle, self._numbers, self._places, self._count)
        return self._values[:]

    def write(self, values: list[int]) -> None:
        """Sets them, in order."""
        self._values[:] = values  # type: ignore[assignment]
        uclib.uc_reg_write_batch(self._handle, self._numbers, self._places, self._count)


def _check(status: int) -> None:
    if status:
        raise unicorn.UcError(status)
