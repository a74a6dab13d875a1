"""The flashed image on a virtual CM-530 with virtual servos: what the tests of the image share."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
from functools import lru_cache
from pathlib import Path

import pytest

from tests.firmware.native import walk
from workbench.device import decode_table
from workbench.device.link import FrameReader, Message, decode_message
from workbench.device.virtual import AX12A, MILLISECOND, SECOND, Clock, RampBody, ServoBus, VirtualServo, bit_flips
from workbench.device.virtual.cm530 import Board
from workbench.robot import BUS_IDS

FIRMWARE = Path(__file__).parents[2] / "firmware"
IDS = [BUS_IDS[j] for j in sorted(BUS_IDS)]
needs_compiler = pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="needs gcc-arm-none-eabi")


@lru_cache(maxsize=1)
def image(folder: str = "runs/firmware") -> bytes:
    """The image, built where sources have changed."""
    digest = hashlib.sha256()
    for path in sorted(FIRMWARE.rglob("*")):
        if path.suffix in (".c", ".h", ".S", ".ld", ".table") or path.name == "Makefile":
            digest.update(path.read_bytes())
    out = FIRMWARE.parent / folder / digest.hexdigest()[:16]
    if not (out / "cm530.bin").exists():
        subprocess.run(["make", "-s", "-C", str(FIRMWARE), f"OUT={out}"], check=True, capture_output=True)
    return (out / "cm530.bin").read_bytes()


class Ear:
    """Hears the servo bus: packets of the board with the start of their first bit [ticks], Sync Writes among them
    (`poses`), and all bytes for the trace's hash."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.packets: list[tuple[int, bytes]] = []
        self.poses: list[tuple[int, bytes]] = []
        self.digest = hashlib.sha256()
        self.bytes = 0
        talk = board.bus.talk

        def heard(talker, values, rate, starts):
            end = talk(talker, values, rate, starts)
            self.digest.update(repr((talker is board, bytes(values), rate, starts)).encode())
            self.bytes += len(values)
            if talker is board:
                self.packets.append((starts, bytes(values)))
                if values[4:6] == b"\x83\x1e":
                    self.poses.append(self.packets[-1])
            return end

        board.bus.talk = heard


class Robot:
    """Board, servos, bus and clock of one robot; to_servos and from_servos: share of bytes flipped."""

    def __init__(self, seed: int = 0, to_servos: float = 0.0, from_servos: float = 0.0, data: bytes | None = None) -> None:
        self.clock = Clock()
        self.bus = ServoBus(self.clock, bit_flips(to_servos, seed) if to_servos else None,
                            bit_flips(from_servos, seed + 1) if from_servos else None)
        self.body = RampBody({i: 0.05 * ((i * 7 + seed) % 5 - 2) for i in IDS})
        self.servos = {i: VirtualServo(self.bus, AX12A, i, self.body, seed=seed) for i in IDS}
        for bounds in decode_table(walk()).joints:
            servo = self.servos[bounds.bus_id]
            servo["cw_angle_limit"], servo["ccw_angle_limit"] = bounds.low, bounds.high
        self.board = Board(data or image(), self.clock, self.bus, seed)
        self.ear = Ear(self.board)
        self._reader = FrameReader()
        self._read = 0
        self.worst = 0.0
        self.board.power_on()

    def run(self, ms: float) -> None:
        self.board.run(self.clock.now + round(ms * MILLISECOND))

    def remote(self, buttons: int) -> None:
        low, high = buttons & 255, buttons >> 8
        self.board.send(self.board.zigbee, bytes([0xFF, 0x55, low, low ^ 255, high, high ^ 255]))

    def messages(self) -> list[Message]:
        new = bytes(self.board.pc.received[self._read:])
        self._read += len(new)
        return [m for f in self._reader.feed(new) if (m := decode_message(f)) is not None]

    def to_neutral(self) -> list[Message]:
        """Until it holds neutral."""
        got: list[Message] = []
        while not any(getattr(m, "state", None) == 4 for m in got):
            assert self.clock.now < 10 * SECOND, got[-3:]
            self.run(50)
            got += self.messages()
        return got

    def play(self) -> None:
        """To neutral, then U."""
        self.to_neutral()
        self.remote(1)
        self.remote(0)
        self.run(5)

    def sound(self) -> None:
        """Nothing that no correct program does has happened."""
        assert not self.board.violations
        assert not self.board.cpu.faults
