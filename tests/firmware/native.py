"""The firmware's core compiled for this machine, with its robot of plain servos (firmware/tests/sim.c), called by ctypes."""

from __future__ import annotations

import ctypes
import hashlib
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path

from workbench.device.link import FrameReader, Message, decode_message
from workbench.device.tables.table_file import TableFile, bounds_of, encode_table
from workbench.motion import load_motion
from workbench.robot import data_file, puppy_model

FIRMWARE = Path(__file__).parents[2] / "firmware"
LINK_PC, LINK_ZIGBEE = 0, 1
POWER_ON = 1
NONE = 2**64 - 1


class CellRun(ctypes.Structure):
    """struct cell_run."""

    _fields_ = [
        ("table", ctypes.c_char_p), ("size", ctypes.c_uint32), ("fault", ctypes.c_uint32), ("watch_ms", ctypes.c_uint32),
        ("seed", ctypes.c_uint64), ("servo", ctypes.c_uint32), ("servo_id", ctypes.c_uint32), ("state", ctypes.c_uint32),
        ("reason", ctypes.c_uint32), ("servo_named", ctypes.c_uint32), ("poses", ctypes.c_uint32), ("limp", ctypes.c_uint32),
        ("fault_us", ctypes.c_uint64), ("ramp_us", ctypes.c_uint64), ("off_us", ctypes.c_uint64),
    ]


def compile_core(flags: tuple[str, ...] = ("-O2",), source: Path = FIRMWARE) -> Path:
    """A shared library of core and tests, made anew where a source has changed. source: another firmware folder."""
    tests = ("sim", "cells", "access", "rude", "rude_people", "monitor")
    sources = sorted([*source.glob("core/*.c"), *(source / "tests" / f"{name}.c" for name in tests)])
    digest = hashlib.sha256()
    for path in sorted([*sources, *source.glob("core/*.h"), *source.glob("tests/*.h")]):
        digest.update(path.read_bytes())
    digest.update(" ".join(flags).encode())
    out = Path(tempfile.gettempdir()) / f"workbench-core-{digest.hexdigest()[:16]}.so"
    if not out.exists():
        part = out.with_suffix(f".{id(out)}.part")
        subprocess.run(["gcc", "-std=c11", *flags, "-shared", "-fPIC", "-o", str(part), *map(str, sources)], check=True)
        part.replace(out)
    return out


@lru_cache(maxsize=1)
def core() -> ctypes.CDLL:
    """The library with its signatures."""
    lib = ctypes.CDLL(str(compile_core()))
    lib.sim_new.restype = ctypes.c_void_p
    lib.sim_random.restype = ctypes.c_uint32
    for name in ("sim_free", "sim_run", "sim_send", "sim_receive", "sim_frame", "sim_remote", "sim_boot", "sim_reset", "sim_get",
                 "sim_set"):
        getattr(lib, name).argtypes = None
    lib.sim_get.restype = ctypes.c_uint64
    return lib


def walk(**options: object) -> bytes:
    """The ROBOTIS walk as `export` writes it."""
    table = load_motion(data_file("robotis_walk.csv")).as_table()
    return encode_table(TableFile(table, bounds_of(table, puppy_model()), **options))  # type: ignore[arg-type]


class Sim:
    """One simulated robot around the core."""

    def __init__(self, table: bytes, cause: int = POWER_ON, seed: int = 0) -> None:
        self.lib, self.table = core(), table
        self.p = ctypes.c_void_p(self.lib.sim_new())
        self._reader = FrameReader()
        self.lib.sim_boot(self.p, table, len(table), cause, ctypes.c_uint64(seed))

    def __del__(self) -> None:
        self.lib.sim_free(self.p)

    def run(self, ms: int) -> None:
        self.lib.sim_run(self.p, ms)

    def send(self, data: bytes, link: int = LINK_PC) -> None:
        """Bytes at 57,600 bit/s."""
        self.lib.sim_send(self.p, link, data, len(data))

    def put(self, data: bytes, link: int = LINK_PC) -> None:
        """Bytes that are there at once; no time goes by."""
        self.lib.sim_put(self.p, link, data, len(data))

    def remote(self, buttons: int) -> None:
        self.lib.sim_remote(self.p, buttons)

    def get(self, what: str, index: int = 0) -> int:
        return int(self.lib.sim_get(self.p, what.encode(), index))

    def set(self, what: str, value: int, index: int = 0) -> None:
        self.lib.sim_set(self.p, what.encode(), index, value)

    def received(self, link: int = LINK_PC) -> bytes:
        buffer = ctypes.create_string_buffer(8192)
        count = self.lib.sim_receive(self.p, link, buffer, 8192)
        return buffer.raw[:count]

    def messages(self, link: int = LINK_PC) -> list[Message]:
        return [m for f in self._reader.feed(self.received(link)) if (m := decode_message(f)) is not None]

    def to_neutral(self) -> None:
        for _ in range(60):
            self.run(50)
            if self.get("state") == 4:
                return
        raise AssertionError("never came to neutral")

    def play(self) -> None:
        self.to_neutral()
        self.remote(1)
        self.remote(0)
        self.run(8)
        assert self.get("state") == 5


def cell(fault: int, seed: int, table: bytes, watch_ms: int, sim: Sim) -> CellRun:
    """One fault at one random moment."""
    run = CellRun(table=table, size=len(table), fault=fault, watch_ms=watch_ms, seed=seed)
    started = sim.lib.cell_run(sim.p, ctypes.byref(run))
    assert started == 0, f"fault {fault}, seed {seed}: never walked"
    return run


def until(sim: Sim, wanted: set[int], most: int = 4000) -> int:
    """Milliseconds until the state is one of these."""
    for ms in range(most):
        if sim.get("state") in wanted:
            return ms
        sim.run(1)
    raise AssertionError(f"still {sim.get('state')} after {most} ms")
