"""The way to a Motive server: UDP sockets, in real time."""

from __future__ import annotations

import select
import socket
import struct
import sys
import time
from contextlib import suppress
from typing import Protocol

from workbench.device.capture.packets import ServerInfo
from workbench.files import InputError

BUFFER = 4 << 20
"""Receive buffer asked of the system [bytes]: some seconds of frames, for a disk that is slow to sync."""


class Link(Protocol):
    """Commands out, packets in, and the clock that stamps them [s]."""

    @property
    def description(self) -> str:
        """The server and the interface, for messages."""

    def now(self) -> float:
        """This machine's monotonic clock."""

    def send(self, data: bytes) -> None:
        """A packet to the server's command port."""

    def subscribe(self, info: ServerInfo) -> None:
        """Opens the socket for the frames, once the server has named it."""

    def receive(self, timeout: float) -> tuple[float, bytes] | None:
        """The next packet and when it came; None after `timeout` [s]."""

    def close(self) -> None:
        """Lets go of the network."""


class UdpLink:
    """Sockets to a Motive server. interface: address of the network interface that the frames come in by; left out, that of the
    route to the server. InputError where there is no such server or interface."""

    def __init__(self, server: str, interface: str | None = None, command_port: int = 1510) -> None:
        if not server:  # an unset shell variable, which stands for every address
            raise InputError(None, "server: expected a name or an address, got nothing")
        try:
            self._server = (socket.gethostbyname(server), command_port)
        except (OSError, UnicodeError) as e:  # UnicodeError: a name that no host can have
            why = getattr(e, "strerror", None) or "too long, or with empty parts"
            raise InputError(None, f"server '{server[:80]}': not a known host ({why})") from None
        self.chosen = interface is None
        self.interface = interface or _route_to(self._server)
        self._command = _udp()
        try:
            self._command.bind((self.interface, 0))
        except OSError:
            self._command.close()
            raise InputError(None, f"interface '{self.interface}': not an address of this machine; expected one of "
                                   f"{', '.join(addresses())}") from None
        self._data: socket.socket | None = None
        self._sender = ""
        self.others: set[str] = set()
        """Addresses of other servers on the same multicast group, whose packets are dropped. The server that was asked may send
        from another of its addresses: then the first sender is taken for it."""

    @property
    def description(self) -> str:
        """Whom this link speaks to, and through what."""
        how = "chosen by the route to it" if self.chosen else "as given"
        return f"server {self._server[0]} through interface {self.interface} ({how}; this machine has {', '.join(addresses())})"

    def now(self) -> float:
        """Time of this link's clock [s]."""
        return time.monotonic()

    def send(self, data: bytes) -> None:
        """Sends a packet to the server; InputError where it cannot be reached."""
        try:
            self._command.sendto(data, self._server)
        except OSError as e:
            raise InputError(None, f"{self.description}: cannot be reached ({e.strerror})") from None

    def subscribe(self, info: ServerInfo) -> None:
        """Joins the multicast group; a server that sends to each client alone sends to the socket of the commands."""
        if info.group is None:
            return
        self._data = _udp()
        try:
            self._data.bind((info.group if sys.platform != "win32" else "", info.data_port))
            member = struct.pack("4s4s", socket.inet_aton(info.group), socket.inet_aton(self.interface))
            self._data.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, member)
        except OSError as e:
            raise InputError(None, f"multicast group {info.group}, port {info.data_port}: cannot be joined ({e.strerror}); "
                                   f"{self.description}") from None

    def receive(self, timeout: float) -> tuple[float, bytes] | None:
        """The next packet and when it came [s], None where none comes within `timeout` [s]."""
        sockets = [s for s in (self._data, self._command) if s is not None]
        ready, _, _ = select.select(sockets, [], [], timeout)
        for s in ready:
            try:
                data, (sender, _) = s.recvfrom(65536)
            except OSError:  # an ICMP answer to an earlier command: nobody listens there
                continue
            if s is self._data:
                if not self._sender or sender == self._server[0]:
                    self._sender = sender
                if sender != self._sender:
                    self.others.add(sender)
                    continue
            return time.monotonic(), data
        return None

    def close(self) -> None:
        """Closes both sockets."""
        for s in (self._command, self._data):
            if s is not None:
                s.close()


def addresses() -> list[str]:
    """IPv4 addresses of this machine's interfaces, loopback last."""
    found = set()
    if sys.platform == "linux":
        import fcntl

        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            for _, name in socket.if_nameindex():
                try:
                    answer = fcntl.ioctl(s.fileno(), 0x8915, struct.pack("256s", name.encode()[:15]))  # SIOCGIFADDR
                except OSError:
                    continue
                found.add(socket.inet_ntoa(answer[20:24]))
    else:
        with suppress(OSError):
            found |= {str(info[4][0]) for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)}
    return [*sorted(found - {"127.0.0.1"}), "127.0.0.1"]


def _udp() -> socket.socket:
    s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    s.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
    return s


def _route_to(server: tuple[str, int]) -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        try:
            s.connect(server)
        except OSError as e:
            raise InputError(None, f"server {server[0]}: no route to it ({e.strerror}); this machine has "
                                   f"{', '.join(addresses())}") from None
        return str(s.getsockname()[0])
