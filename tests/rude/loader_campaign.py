"""The loader's side of the campaign: a program is loaded while something goes wrong at the k-th byte of the conversation.

The campaign compares what `flash` reports with the program in the emulated controller.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field

from tests.firmware.emulated_loader import Controller, EmulatedLoader
from workbench.device.controller.loader import ASKED, HALF, LOADED, UNKNOWN, UNTOUCHED, LoadError, Loading, Transcript
from workbench.device.controller.loader_profile import load_loader_profile

PROFILE = load_loader_profile()
IMAGE = struct.pack("<II", 0x20010000, 0x08003101) + random.Random(0).randbytes(600)
TRUTH = {UNTOUCHED: {"factory"}, ASKED: {"factory", "nothing"}, HALF: {"nothing"}, UNKNOWN: {"new", "nothing"},
         LOADED: {"new"}}
"""Programs that the controller may hold after each report."""
FAULTS = ("cut", "sent byte lost", "sent byte flipped", "heard byte lost", "heard byte flipped", "deaf", "mute", "switched off",
          "late", "burst lost", "noise")
AGAIN = ("sent byte lost", "sent byte flipped", "heard byte lost", "heard byte flipped", "noise")
"""Faults that may strike at every so many bytes."""


class RudeLoader(EmulatedLoader):
    """The emulated loader behind a faulty line. k: the byte, counted over both directions, at which the fault strikes; every:
    again after so many bytes, 0: once."""

    def __init__(self, controller: Controller, fault: str, k: int, every: int, seed: int) -> None:
        super().__init__(PROFILE, controller)
        self.fault, self.k, self.every, self.struck = fault, k, every, 0
        self.rng = random.Random(seed)

    def _hit(self) -> bool:
        self._cross()
        here = self.crossed == self.k or bool(self.every and self.crossed > self.k and (self.crossed - self.k) % self.every == 0)
        self.struck += here
        if here:
            self._whole()
        return here

    def _whole(self) -> None:
        """Faults of the controller or the adapter rather than of a byte."""
        if self.fault == "cut":
            self._cut_after = self.crossed
        elif self.fault == "deaf":
            self._deaf = True
        elif self.fault == "mute":
            self._mute = True
        elif self.fault == "late":
            self._late = self.rng.uniform(0.01, 1.0)
        elif self.fault == "switched off":  # and on again, with the key no longer held
            self._out.clear()
            self._command, self._image, self._mode = b"", b"", "key"

    def write(self, data: bytes) -> None:
        """The PC sends."""
        for value in data:
            hit = self._hit()
            if self.fault == "sent byte flipped" and hit:
                value ^= 1 << self.rng.randrange(8)
            lost = hit and (self.fault == "sent byte lost" or self.fault == "burst lost")
            if not lost and not self._deaf:
                self._take(bytes([value]))
        self.time += len(data) * 10 / PROFILE.rate

    def read(self, seconds: float) -> bytes:
        """Bytes that come within this time."""
        self.time += seconds
        self._settle()
        out = b"".join(text for due, text in self._out if due <= self.time)
        self._out = [(due, text) for due, text in self._out if due > self.time]
        got = b""
        for value in out:
            if self._hit():
                if self.fault in ("heard byte lost", "burst lost"):
                    continue
                if self.fault == "heard byte flipped":
                    value ^= 1 << self.rng.randrange(8)
                if self.fault == "noise":
                    got += self.rng.randbytes(self.rng.randrange(1, 6))
            got += bytes([value])
        return got


@dataclass
class Run:
    """One loading with one fault."""

    fault: str
    k: int
    every: int = 0
    seed: int = 0
    struck: int = field(init=False, default=0)
    undetected: bool = field(init=False, default=False)
    """Whether a damaged image passed the loader's own check, a sum of one byte: by chance one in 256 does."""

    def play(self) -> list[str]:
        """Loads, and returns the wrong reports, a line each."""
        controller = Controller()
        line = RudeLoader(controller, self.fault, self.k, self.every, self.seed)
        out: list[str] = []
        try:
            Loading(line, PROFILE, Transcript(now=lambda: line.time)).run(IMAGE)
            if controller.runs != "new":
                out.append(f"said to be loaded, and it runs {controller.runs}")
        except LoadError as e:
            if controller.runs not in TRUTH[e.state]:
                out.append(f"'{e.what}; {e.state}', and it runs {controller.runs}")
        self.struck = line.struck
        self.undetected = controller.runs == "new" and controller.program != IMAGE
        second = EmulatedLoader(PROFILE, controller)
        Loading(second, PROFILE, Transcript(now=lambda: second.time)).run(IMAGE)
        if (controller.runs, controller.program) != ("new", IMAGE):
            out.append("the second attempt did not load it")
        return out


def length() -> int:
    """Bytes of a whole conversation, both ways."""
    line = EmulatedLoader(PROFILE, Controller())
    Loading(line, PROFILE, Transcript(now=lambda: line.time)).run(IMAGE)
    return line.crossed


def runs(seed: int) -> Iterator[Run]:
    """Without end: every fault at places all over the conversation, half of them where commands are typed, not the image."""
    rng, whole = random.Random(seed), length()
    while True:
        for fault in FAULTS:
            k = rng.randrange(1, whole) if rng.random() < 0.5 else rng.randrange(1, 220)
            every = 1 if fault == "burst lost" else rng.choice((0, 0, 53, 211)) if fault in AGAIN else 0
            yield Run(fault, k, every, rng.randrange(10_000))


def campaign(faults: int, seed: int = 0) -> tuple[int, list[tuple[Run, str]]]:
    """Runs until so many faults have struck; their number, and the violations of each run. A run counts as at most ten."""
    struck, out = 0, []
    for run in runs(seed):
        out += [(run, line) for line in run.play()]
        struck += min(max(run.struck, 1), 10)
        if struck >= faults:
            return struck, out
    raise AssertionError
