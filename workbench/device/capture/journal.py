"""The recording while it runs: every packet as it came; a killed program loses none, a power cut a second."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

from workbench.files import InputError
from workbench.files.appended import AppendedFile

MAGIC = b"workbench natnet journal 2\n"
SYNC_EVERY = 0.5
"""Longest time between two calls of fsync [s]: half of the second that a power cut may cost."""
_ENTRY = struct.Struct("<Id")


class Journal(AppendedFile):
    """Appends packets to a new file."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, "a recording that was cut short; finish it with `workbench record --finish`, or move it away",
                         SYNC_EVERY)
        self.append(MAGIC)

    def packet(self, arrival: float, data: bytes) -> None:
        """A packet, and when it came on this machine's monotonic clock [s]."""
        self.append(_ENTRY.pack(len(data), arrival) + data)


def read_journal(path: str | Path) -> Iterator[tuple[float, bytes]]:
    """Arrival [s] and bytes of each packet; one that is cut at the end is left out. InputError where the file is none."""
    path = Path(path)
    try:
        file = path.open("rb")
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None
    with file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError(path, "not a recording cut short; expected one that this version of `workbench record` left behind")
        while len(head := file.read(_ENTRY.size)) == _ENTRY.size:
            size, arrival = _ENTRY.unpack(head)
            data = file.read(size)
            if len(data) == size:
                yield arrival, data
