"""An emulated Motive: answers a client's commands and streams frames of NatNet 2.7 to 4.4, with faults by a seed.

Written from the layouts of OptiTrack's NatNet SDK, apart from the decoder that reads it.
"""

from __future__ import annotations

import heapq
import random
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from workbench.device.capture.packets import GROUP, HIRES, PRECISION, Message, ServerInfo, Version, packet

TICKS = 10_000_000
"""Ticks per second of the server's clock, as Windows counts them."""
LATENCY = 4e-3
"""From mid-exposure to the frame on the network [s]."""
DELAY = 0.2e-3
"""Of a packet to or from the server [s], as on a local network."""
_SENDER = struct.Struct("<256s4B4B")

Pose = tuple[tuple[float, float, float], tuple[float, float, float, float], bool]
"""p [m] and quaternion xyzw in the capture's axes, and whether the body is seen."""
Scene = Callable[[float], Mapping[str, Pose]]
"""Poses of the rigid bodies at a time since the server was started [s]."""


@dataclass(frozen=True)
class Faults:
    """Share of frames that are lost, broken (cut), sent twice, or come after the one that follows them."""

    lost: float = 0.0
    broken: float = 0.0
    doubled: float = 0.0
    swapped: float = 0.0


@dataclass
class Sent:
    """Numbers of the frames that each fault hit."""

    lost: set[int] = field(default_factory=set)
    broken: set[int] = field(default_factory=set)
    doubled: set[int] = field(default_factory=set)
    swapped: set[int] = field(default_factory=set)


class VirtualMotive:
    """A server without sockets: `answer` takes a client's packet, `due` gives the frames up to a time.

    scene: the bodies in view. started: time of its first mid-exposure on the caller's clock [s]. clock: its own clock at that
    moment [s], which runs `clock_ratio` times as fast. group: multicast, or None. precision: whether frames from 4.1 on carry the
    precision time stamp.
    """

    def __init__(self, names: tuple[str, ...], scene: Scene, *, version: Version = (4, 1), rate: float = 240.0,
                 group: str | None = GROUP, data_port: int = 1511, faults: Faults | None = None, seed: int = 0,
                 started: float = 0.0, clock: float = 1000.0, clock_ratio: float = 1.0, precision: bool = True) -> None:
        self.names, self.version, self.rate, self.started = names, version, rate, started
        self.sent, self.recording, self.take_name = Sent(), False, ""
        self.first_number = 1001
        self._scene, self._group, self._port = scene, group, data_port
        self._faults, self._random = faults or Faults(), random.Random(seed)
        self._clock, self._ratio, self._precision = clock, clock_ratio, precision
        self._next = 0
        self._queue: list[tuple[float, int, bytes]] = []
        self._order = 0
        self.keep_alives = 0

    def clock(self, now: float) -> float:
        """The server's own clock [s] at a time of the caller's."""
        return self._clock + (now - self.started) * self._ratio

    def mid_exposure(self, number: int) -> float:
        """Time of a frame's mid-exposure on the server's clock [s]."""
        return self.clock(self.started + (number - self.first_number) / self.rate)

    def answer(self, data: bytes, now: float) -> list[bytes]:
        """The server's answer to a packet at a time [s] of the caller's clock."""
        kind, size = struct.unpack_from("<HH", data)
        payload = data[4:4 + size]
        if kind == Message.CONNECT:
            return [self._server_info()]
        if kind == Message.REQUEST_MODELDEF:
            return [self._descriptions()]
        if kind == Message.KEEP_ALIVE:
            self.keep_alives += 1
            return []
        if kind == Message.ECHO_REQUEST and self.version >= HIRES:
            return [packet(Message.ECHO_RESPONSE, payload[:8] + struct.pack("<Q", round(self.clock(now) * TICKS)))]
        if kind == Message.REQUEST:
            return [self._command(payload.partition(b"\0")[0].decode())]
        return [packet(Message.UNRECOGNIZED_REQUEST)]

    def due(self, now: float) -> list[tuple[float, bytes]]:
        """Frames that are on the network by a time [s] of the caller's clock, in the order in which they come."""
        while self.started + self._next / self.rate + LATENCY <= now:
            self._emit(self._next)
            self._next += 1
        out = []
        while self._queue and self._queue[0][0] <= now:
            t, _, data = heapq.heappop(self._queue)
            out.append((t, data))
        return out

    def _emit(self, k: int) -> None:
        number, sent = self.first_number + k, self.sent
        data = self._frame(number, k / self.rate)
        at = self.started + k / self.rate + LATENCY
        draw, f = self._random.random(), self._faults
        if draw < f.lost:
            sent.lost.add(number)
            return
        if draw < f.lost + f.broken:
            sent.broken.add(number)
            data = data[:self._random.randrange(8, len(data))]
        elif draw < f.lost + f.broken + f.doubled:
            sent.doubled.add(number)
            self._schedule(at + 0.3 / self.rate, data)
        elif draw < f.lost + f.broken + f.doubled + f.swapped:
            sent.swapped.add(number)
            at += 1.5 / self.rate
        self._schedule(at, data)

    def _schedule(self, at: float, data: bytes) -> None:
        self._order += 1
        heapq.heappush(self._queue, (at, self._order, data))

    def _command(self, text: str) -> bytes:
        word, _, value = text.partition(",")
        if word == "SetRecordTakeName":
            self.take_name = value
        elif word in ("StartRecording", "StopRecording"):
            self.recording = word == "StartRecording"
        else:
            return packet(Message.UNRECOGNIZED_REQUEST)
        return packet(Message.RESPONSE, struct.pack("<i", 0))

    def _server_info(self) -> bytes:
        out = _SENDER.pack(b"Motive", *self.version, 0, 0, *self.version, 0, 0)
        if self.version >= HIRES:
            group = [int(b) for b in (self._group or GROUP).split(".")]
            out += struct.pack("<QH?4B", TICKS, self._port, self._group is not None, *group)
        return packet(Message.SERVER_INFO, out)

    def _descriptions(self) -> bytes:
        out = struct.pack("<I", len(self.names))
        for i, name in enumerate(self.names, start=1):
            body = name.encode() + b"\0" + struct.pack("<ii3f", i, -1, 0.0, 0.0, 0.0)
            if self.version >= (4, 2):
                body += struct.pack("<4f", 0.0, 0.0, 0.0, 1.0)
            if self.version >= HIRES:
                body += struct.pack("<I3fI", 1, 0.01, 0.0, 0.0, 0) + (b"marker\0" if self.version >= (4, 0) else b"")
            size = struct.pack("<I", len(body)) if self.version >= PRECISION else b""
            out += struct.pack("<I", 1) + size + body
        return packet(Message.MODELDEF, out)

    def _frame(self, number: int, t: float) -> bytes:
        v = self.version
        out = struct.pack("<I", number)
        out += self._section(1, b"all\0" + struct.pack("<I3f", 1, 0.0, 0.0, 0.0))
        out += self._section(1, struct.pack("<3f", 1.0, 1.0, 1.0))  # unlabelled markers
        scene = self._scene(t)
        bodies = [self._body(i, scene[name]) for i, name in enumerate(self.names, start=1)]
        out += self._section(len(bodies), b"".join(bodies))
        out += self._section(0)  # skeletons
        if v >= (4, 1):
            out += self._section(0)  # assets
        out += self._section(1, self._marker())
        if v >= (2, 9):
            out += self._section(0)  # force plates
        if v >= (2, 11):
            out += self._section(0)  # devices
        out += (b"" if v >= HIRES else struct.pack("<f", LATENCY)) + struct.pack("<II", 0, 0)
        exposed = self.mid_exposure(number)
        out += struct.pack("<d", exposed)
        if v >= HIRES:
            ticks = round(exposed * TICKS)
            out += struct.pack("<QQQ", ticks, ticks + 20_000, ticks + 30_000)
        if v >= PRECISION and self._precision:
            out += struct.pack("<II", 1_700_000_003, 12345)
        return packet(Message.FRAME, out + struct.pack("<HI", int(self.recording), 0))

    def _section(self, count: int, content: bytes = b"") -> bytes:
        size = struct.pack("<I", len(content)) if self.version >= PRECISION else b""
        return struct.pack("<I", count) + size + content

    def _body(self, number: int, pose: Pose) -> bytes:
        p, quat, seen = pose
        out = struct.pack("<I7f", number, *p, *quat)
        if self.version < HIRES:
            out += struct.pack("<I3fIf", 1, *p, 1, 0.01)
        return out + struct.pack("<fH", 0.0002 if seen else 0.0, int(seen))

    def _marker(self) -> bytes:
        out = struct.pack("<I4f", 1, 0.0, 0.0, 0.0, 0.01)
        if self.version >= (2, 6):
            out += struct.pack("<H", 2)
        return out + (struct.pack("<f", 0.0002) if self.version >= HIRES else b"")


class VirtualLink:
    """An emulated server in this process; waiting costs virtual time only."""

    def __init__(self, server: VirtualMotive) -> None:
        self._server, self._now = server, server.started
        self._waiting: list[tuple[float, bytes]] = []

    @property
    def description(self) -> str:
        """Whom this link speaks to, and through what."""
        return "emulated server"

    def now(self) -> float:
        """Time of this link's clock [s]."""
        return self._now

    def send(self, data: bytes) -> None:
        """Sends a packet to the server; InputError where it cannot be reached."""
        self._waiting += [(self._now + 2 * DELAY, a) for a in self._server.answer(data, self._now + DELAY)]

    def subscribe(self, info: ServerInfo) -> None:
        """Nothing to join: the emulated server sends to this link."""

    def receive(self, timeout: float) -> tuple[float, bytes] | None:
        """The next packet and when it came [s], None where none comes within `timeout` [s]."""
        end = self._now + timeout
        self._waiting += [(t + DELAY, data) for t, data in self._server.due(end - DELAY)]
        self._waiting.sort(key=lambda item: item[0])
        if not self._waiting or self._waiting[0][0] > end:
            self._now = end
            return None
        arrival, data = self._waiting.pop(0)
        self._now = max(self._now, arrival)
        return self._now, data

    def close(self) -> None:
        """Nothing to close."""
