"""NatNet packets, versions 2.7 to 4.x: descriptions of a Motive server, its assets and each frame.

The layout of frames and asset descriptions is that of the PyPI package natnet. Lengths, end and time stamps are read here: its
decoder knows neither the software latency of 2.x nor the precision time stamp of 4.1 and later.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum

from natnet.data_descriptions import DataDescriptions
from natnet.data_frame import DataFrame
from natnet.packet_buffer import PacketBuffer
from natnet.version import Version as NatNetVersion

Version = tuple[int, int]

OLDEST: Version = (2, 7)
HIRES: Version = (3, 0)
"""From here on frames carry the cameras' mid-exposure time in ticks of the server's clock, and the server answers an echo."""
PRECISION: Version = (4, 1)
GROUP = "239.255.42.99"
"""Multicast address that Motive sets by default."""


class Message(IntEnum):
    """Kinds of packets (NatNet SDK, client/server message ids)."""

    CONNECT = 0
    SERVER_INFO = 1
    REQUEST = 2
    RESPONSE = 3
    REQUEST_MODELDEF = 4
    MODELDEF = 5
    FRAME = 7
    KEEP_ALIVE = 10
    ECHO_REQUEST = 12
    ECHO_RESPONSE = 13
    UNRECOGNIZED_REQUEST = 100
    NOTE = 0xFFFF
    """No message of NatNet: this program's own entry in its journal, JSON."""


class BrokenPacketError(ValueError):
    """A packet that is cut, too long, or holds what cannot be."""


@dataclass(frozen=True)
class ServerInfo:
    """Description of a server. version: of the bit stream. clock_frequency: ticks/s of its time stamps (NaN before
    3.0). group: multicast address, None where it sends to each client alone; before 3.0, where it is not given, the usual one."""

    application: str
    application_version: str
    version: Version
    clock_frequency: float
    data_port: int
    group: str | None


@dataclass(frozen=True)
class BodyPose:
    """One rigid body in one frame: p [m] and quaternion xyzw in the capture's axes, mean marker error [m]; tracked: seen now
    (Motive repeats the last pose where it is not)."""

    id: int
    p: tuple[float, float, float]
    quat: tuple[float, float, float, float]
    error: float
    tracked: bool


@dataclass(frozen=True)
class Frame:
    """One frame. time: of mid-exposure on the server's clock [s] (before 3.0: its own time stamp). recording: whether Motive
    itself records. models_changed: the list of assets is no longer the one described."""

    number: int
    time: float
    bodies: tuple[BodyPose, ...]
    recording: bool
    models_changed: bool


class _Buffer(PacketBuffer):  # type: ignore[misc]
    """The same buffer as natnet's, whose 8-byte integers are 4 bytes long on Windows."""

    def read_uint64(self) -> int:
        return int(self.read("<Q")[0])


def packet(message: Message, payload: bytes = b"") -> bytes:
    """A whole packet: kind and length of the payload before it, little endian."""
    return struct.pack("<HH", message, len(payload)) + payload


def kind_of(data: bytes) -> int:
    """Kind of a packet; BrokenPacketError where its length is not the one it states."""
    if len(data) < 4:
        raise BrokenPacketError(f"{len(data)} bytes; expected a header of 4")
    kind, size = struct.unpack_from("<HH", data)
    if len(data) != size + 4:
        raise BrokenPacketError(f"{len(data) - 4} bytes after the header; it states {size}")
    return int(kind)


def stated_number(data: bytes) -> int | None:
    """Number of the frame that a broken packet held, if so much of it came."""
    return int(struct.unpack_from("<I", data, 4)[0]) if len(data) >= 8 and data[:2] == struct.pack("<H", Message.FRAME) else None


def parse_server_info(data: bytes) -> ServerInfo:
    """Reads a SERVER_INFO packet."""
    kind_of(data)
    body = data[4:]
    if len(body) < 264:
        raise BrokenPacketError(f"server information of {len(body)} bytes; expected 264 or more")
    name = body[:256].partition(b"\0")[0].decode("utf-8", "replace")
    version = (body[260], body[261])
    clock, port, group = float("nan"), 1511, GROUP if version < HIRES else None
    if len(body) >= 264 + 15:
        ticks, port, multicast = struct.unpack_from("<QH?", body, 264)
        clock = float(ticks) or float("nan")
        group = ".".join(str(b) for b in body[275:279]) if multicast else None
    return ServerInfo(name, ".".join(str(b) for b in body[256:260]), version, clock, port, group)


def parse_names(data: bytes, version: Version) -> dict[int, str]:
    """Names of the rigid bodies in a MODELDEF packet, by their number."""
    kind_of(data)
    try:
        found = DataDescriptions.read_from_buffer(_Buffer(data[4:]), NatNetVersion(*version))
    except Exception as e:  # natnet lets struct, decoding and its own errors through
        raise BrokenPacketError(f"description of assets: {e}") from None
    return {int(body.id_num): str(body.name) for body in found.rigid_bodies}


def parse_frame(data: bytes, info: ServerInfo) -> Frame:
    """Reads a FRAME packet; BrokenPacketError where it is not whole to the byte."""
    kind_of(data)
    buffer = _Buffer(data[4:])
    try:
        raw = DataFrame.read_from_buffer(buffer, NatNetVersion(*info.version))
    except Exception as e:
        raise BrokenPacketError(f"frame: {e}") from None
    _check_end(len(data) - 4 - buffer.pointer, data, info.version)
    if info.version >= HIRES:
        time = raw.suffix.stamp_camera_mid_exposure / info.clock_frequency
    else:
        (time,) = struct.unpack_from("<d", data, len(data) - 14)
    (flags,) = struct.unpack_from("<H", data, len(data) - 6)
    bodies = tuple(_pose(body) for body in raw.rigid_bodies)
    return Frame(int(raw.prefix.frame_number), float(time), bodies, bool(flags & 1), bool(flags & 2))


def _check_end(left: int, data: bytes, version: Version) -> None:
    """What natnet's decoder leaves over: the end tag, and the fields that it does not know."""
    allowed = {4}
    if version < HIRES:
        allowed = {4, 8}  # software latency, in most servers of 2.x
    elif version >= PRECISION:
        allowed = {4, 12}  # precision time stamp
    if left not in allowed:
        raise BrokenPacketError(f"frame: {left} bytes after its last field; expected {' or '.join(map(str, sorted(allowed)))}")
    if data[-4:] != b"\0\0\0\0":
        raise BrokenPacketError("frame: its end tag is not zero")


def _pose(body: object) -> BodyPose:
    quat = tuple(float(x) for x in body.rot)  # type: ignore[attr-defined]
    norm = sum(x * x for x in quat)
    if not (abs(norm - 1) < 0.02 or norm == 0):
        raise BrokenPacketError(f"rigid body {body.id_num}: quaternion of length {norm ** 0.5:.3g}")  # type: ignore[attr-defined]
    tracked = bool(body.tracking_valid) and norm > 0  # type: ignore[attr-defined]
    return BodyPose(int(body.id_num), tuple(float(x) for x in body.pos), quat,  # type: ignore[attr-defined, arg-type]
                    float(body.marker_error), tracked)  # type: ignore[attr-defined]
