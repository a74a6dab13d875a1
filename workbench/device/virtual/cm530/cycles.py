"""Counting cycles at each block of code. Where a C compiler is at hand it does so, many times as fast; the counts are equal."""

from __future__ import annotations

import ctypes
import hashlib
import shutil
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import unicorn
from unicorn import arm_const as arm
from unicorn.unicorn_py3.unicorn import uclib

SOURCE = Path(__file__).with_name("cycles.c")


class Cycles(ctypes.Structure):
    """now [ticks]; limit: when to stop; wish: stop as soon as interrupts are not masked. (The same as struct cycles.)"""

    _fields_ = [
        ("now", ctypes.c_int64), ("limit", ctypes.c_int64), ("wish", ctypes.c_int32), ("primask", ctypes.c_int32),
        ("stop", ctypes.c_void_p), ("read", ctypes.c_void_p),
    ]
    now: int
    limit: int
    wish: int

    def attach(self, uc: unicorn.Uc) -> None:
        """Has every block of code counted."""
        hook = _library()
        if hook is None:
            uc.hook_add(unicorn.UC_HOOK_BLOCK, self._block)
            return
        self.primask = arm.UC_ARM_REG_PRIMASK
        self.stop = ctypes.cast(uclib.uc_emu_stop, ctypes.c_void_p).value
        self.read = ctypes.cast(uclib.uc_reg_read, ctypes.c_void_p).value
        handle = ctypes.c_size_t()
        everywhere = ctypes.c_uint64(1), ctypes.c_uint64(0)
        call = ctypes.cast(hook.on_block, ctypes.c_void_p)
        status = uclib.uc_hook_add(uc._uch, ctypes.byref(handle), unicorn.UC_HOOK_BLOCK, call,
                                   ctypes.cast(ctypes.pointer(self), ctypes.c_void_p), *everywhere)
        if status:
            raise unicorn.UcError(status)

    def _block(self, uc: unicorn.Uc, address: int, size: int, _: Any) -> None:
        self.now += (size >> 1) or 1
        if self.now >= self.limit or (self.wish and not uc.reg_read(arm.UC_ARM_REG_PRIMASK)):
            self.wish = 0
            uc.emu_stop()


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL | None:
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    digest = hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]
    out = Path(tempfile.gettempdir()) / f"workbench-cycles-{digest}.so"
    if not out.exists():
        part = Path(tempfile.mkdtemp()) / out.name
        command = [compiler, "-O2", "-shared", "-fPIC", "-o", str(part), str(SOURCE)]
        made = subprocess.run(command, capture_output=True, check=False)
        if made.returncode:
            return None
        part.replace(out)
    return ctypes.CDLL(str(out))
