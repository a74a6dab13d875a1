"""The cameras' side of the campaign: a take is recorded while every k-th packet of the network fails.

The take is judged against the scene that the emulated server shows: a cell is blank or right, losses are reported, and every
recording ends with a sentence. Bits do not flip, as UDP drops a datagram whose checksum is wrong.
"""

from __future__ import annotations

import json
import math
import random
import struct
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from workbench.device.capture import Recorder, record_take
from workbench.device.capture.packets import Message
from workbench.device.capture.recorder import RecordOptions
from workbench.device.virtual.motive import VirtualLink, VirtualMotive
from workbench.files import InputError
from workbench.recording.formats.read import read_recording

NAMES = ("body", "tail")
RATE, SECONDS = 100.0, 0.6
VERSIONS = ((2, 10), (3, 0), (4, 1), (4, 4))
FAULTS = ("lost", "cut", "doubled", "late", "noise", "stream ends", "server restarts", "hidden", "fast clock",
          "command lost", "killed")
WHOLE_RUN = ("fast clock",)
ONCE = ("stream ends", "server restarts", "killed")


def scene(t: float) -> dict:
    """Two bodies that move slowly enough for a frame's time to be known to a millisecond."""
    a = 0.2 * math.sin(3 * t)
    quat = (0.0, math.sin(a / 2), 0.0, math.cos(a / 2))
    return {name: ((0.1 * k + 0.05 * math.sin(2 * t + k), 0.02 * k, 0.1 * math.cos(t)), quat, True)
            for k, name in enumerate(NAMES)}


class RudeLink(VirtualLink):
    """The network between an emulated server and the recorder, on which one kind of thing goes wrong at every k-th packet."""

    def __init__(self, server: VirtualMotive, fault: str, k: int, seed: int) -> None:
        super().__init__(server)
        self.fault, self.k, self.struck, self.count = fault, k, 0, 0
        self.rng = random.Random(seed)
        self.ended = self.killed = False
        self.ended_at = math.inf
        self.dropped: set[int] = set()
        self._extra: list[tuple[float, bytes]] = []

    def _due(self) -> bool:
        self.count += 1
        hit = self.count == self.k + 3 if self.fault in ONCE else self.count % self.k == 0
        self.struck += hit
        return hit

    def send(self, data: bytes) -> None:
        """A packet to the server."""
        if not (self.fault == "command lost" and self._due()):
            super().send(data)

    def receive(self, timeout: float) -> tuple[float, bytes] | None:
        """The next packet, if it comes."""
        if self._extra:
            return self._extra.pop(0)
        got = super().receive(timeout)
        if got is None or self.ended:
            return None
        return self._spoil(*got) if self.fault != "command lost" and self._due() else got

    def _spoil(self, at: float, data: bytes) -> tuple[float, bytes] | None:
        rng = self.rng
        if self.fault == "lost":
            if struct.unpack_from("<H", data)[0] == Message.FRAME:
                self.dropped.add(struct.unpack_from("<I", data, 4)[0])
            return None
        if self.fault == "cut":
            return at, data[:rng.randrange(len(data))]
        if self.fault == "doubled":
            self._extra.append((at, data))
        elif self.fault == "late":
            self._waiting.append((at + rng.uniform(0, 0.1), data))
            return None
        elif self.fault == "noise":
            self._extra.append((at, rng.randbytes(rng.randrange(1, 200))))
        elif self.fault == "stream ends":
            self.ended, self.ended_at = True, at
            return None
        elif self.fault == "server restarts":
            self._server.first_number += rng.choice((20_000, 100_000))
        elif self.fault == "killed":
            self.killed = True
            raise KeyboardInterrupt
        return at, data


@dataclass
class Run:
    """One recording with one kind of fault at every k-th packet, or once after the k-th."""

    fault: str
    k: int
    seed: int = 0
    struck: int = field(init=False, default=0)

    def play(self) -> list[str]:
        """Records, and returns the violations, a line each."""
        with tempfile.TemporaryDirectory() as folder:
            return self._play(Path(folder) / "take.csv")

    def _play(self, path: Path) -> list[str]:
        rng = random.Random(self.seed)
        hide = self.fault == "hidden"

        def shown(t: float) -> dict:
            poses = scene(t)
            if hide and int(t * RATE) % max(self.k, 2) == 0:
                poses["tail"] = (*poses["tail"][:2], False)
            return poses

        motive = VirtualMotive(NAMES, shown, version=rng.choice(VERSIONS), rate=RATE, seed=self.seed,
                               clock_ratio=1.01 if self.fault == "fast clock" else 1.0)
        link = RudeLink(motive, self.fault, self.k, self.seed)
        recorder = Recorder(link, RecordOptions(first_frame=1.0, silence=0.5))
        try:
            capture = record_take(recorder, path, lambda: False, SECONDS)
        except InputError as e:
            self.struck = link.struck
            return [] if str(e) else ["ended without a word"]
        except KeyboardInterrupt:
            self.struck = link.struck
            return [] if link.killed else ["KeyboardInterrupt that nobody pressed"]
        self.struck = max(link.struck, self.fault in WHOLE_RUN or hide)
        out = self._cells(path, motive, capture.counts.first)
        if SECONDS - link.ended_at > 0.3 and not capture.problems:
            out.append(f"the stream ended after {link.ended_at:.2f} s, and nothing is said of it")
        report = json.loads(path.with_suffix(".capture.json").read_text())
        lost = [n for n in link.dropped if report["frames"]["first"] < n < report["frames"]["last"]]
        if self.fault == "lost" and report["frames"]["lost"] != len(lost):
            out.append(f"{len(lost)} frames lost, {report['frames']['lost']} said to be")
        return out

    def _cells(self, path: Path, motive: VirtualMotive, first: int) -> list[str]:
        """Each cell of the take against the scene at its own time."""
        take = read_recording(path)
        number = first - motive.first_number if self.fault != "server restarts" else first - 1001
        out = []
        for k, name in enumerate(NAMES):
            if name not in take.rigid_bodies:
                continue
            p = np.asarray(take.rigid_bodies[name].p)
            times = (number + np.arange(len(p))) / RATE
            truth = np.array([scene(float(t))[name][0] for t in times])
            wrong = np.flatnonzero(np.nanmax(np.abs(p - truth), axis=1, initial=0.0, where=np.isfinite(p)) > 1e-4)
            if len(wrong):
                out.append(f"{name}: {len(wrong)} of {len(p)} rows are wrong, the first is row {wrong[0]}: {p[wrong[0]]} for "
                           f"{truth[wrong[0]]} (body {k})")
        return out


def runs(seed: int) -> Iterator[Run]:
    """Without end: every fault, at every third to every fortieth packet."""
    rng = random.Random(seed)
    while True:
        for fault in FAULTS:
            yield Run(fault, rng.randrange(3, 41), rng.randrange(10_000))


def campaign(faults: int, seed: int = 0) -> tuple[int, list[tuple[Run, str]]]:
    """Runs until so many faults have struck; their number, and the violations of each run."""
    struck, out = 0, []
    for run in runs(seed):
        out += [(run, line) for line in run.play()]
        struck += max(run.struck, 1)
        if struck >= faults:
            return struck, out
    raise AssertionError
