"""Another emulator's processor runs the cross-compiled core: what it sends to the servos is what the native core sends."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.firmware.native import FIRMWARE

SHARED = [*sorted(FIRMWARE.glob("core/*.c")), FIRMWARE / "tests/sim.c", FIRMWARE / "tests/witness.c"]
TABLE = f'-DTABLE_FILE="{FIRMWARE / "robotis_walk.table"}"'
ARM = ["-mcpu=cortex-m3", "-mthumb", "-Os", "-ffreestanding", "-fno-tree-loop-distribute-patterns", "-nostdlib",
       "-Wl,--section-start=.vectors=0", "-Wl,-Ttext=0x100", "-Wl,-Tbss=0x20000000", "-Wl,-e,main"]


@pytest.mark.skipif(not (shutil.which("qemu-system-arm") and shutil.which("arm-none-eabi-gcc")), reason="needs qemu-system-arm")
def test_qemu_sends_what_the_native_core_sends(tmp_path: Path) -> None:
    sources = list(map(str, SHARED))
    subprocess.run(["gcc", "-std=gnu11", "-O2", TABLE, *sources, "-o", "native"], cwd=tmp_path, check=True)
    command = ["arm-none-eabi-gcc", "-std=gnu11", *ARM, TABLE, *sources, "-lgcc", "-o", "arm.elf"]
    subprocess.run(command, cwd=tmp_path, check=True)
    native = subprocess.run(["./native"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    qemu = ["qemu-system-arm", "-M", "mps2-an385", "-nographic", "-monitor", "none", "-serial", "file:sent.txt"]
    command = [*qemu, "-semihosting-config", "enable=on,target=native", "-kernel", "arm.elf"]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=120)
    assert (tmp_path / "sent.txt").read_text() == native
    assert len(native.splitlines()) > 40
