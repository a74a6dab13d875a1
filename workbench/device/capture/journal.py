"""The recording while it runs: packets as they came, appended at once; a killed program loses none, a power cut a second."""

from __future__ import annotations

import json
import os
import struct
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from workbench.files import InputError

MAGIC = b"workbench natnet journal 1\n"
SYNC_EVERY = 0.5
"""Longest time between two calls of fsync [s]: half of the second that a power cut may cost."""
_ENTRY = struct.Struct("<cId")


@dataclass(frozen=True)
class Entry:
    """One entry. kind: b"P" packet, b"C" clock (JSON), b"H" head (JSON). arrival: on this machine's monotonic clock [s]."""

    kind: bytes
    arrival: float
    content: bytes

    def json(self) -> dict[str, Any]:
        """Content of a head or a clock."""
        return dict(json.loads(self.content))


class Journal:
    """Appends entries; a file of that name must not be there."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError:
            raise InputError(path, "a recording that was cut short; finish it with `workbench record --finish`, or move it away"
                             ) from None
        except OSError as e:
            raise InputError(path, f"cannot be written ({e.strerror})") from None
        self._synced = time.monotonic()
        self._write(MAGIC)

    def __enter__(self) -> Journal:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def packet(self, arrival: float, data: bytes) -> None:
        """A packet as it came."""
        self._entry(b"P", arrival, data)

    def note(self, kind: bytes, arrival: float, content: Mapping[str, Any]) -> None:
        """A head or a clock measurement."""
        self._entry(kind, arrival, json.dumps(content).encode())

    def close(self) -> None:
        """On the disk, and closed."""
        if self._file >= 0:
            os.fsync(self._file)
            os.close(self._file)
            self._file = -1

    def _entry(self, kind: bytes, arrival: float, content: bytes) -> None:
        self._write(_ENTRY.pack(kind, len(content), arrival) + content)

    def _write(self, data: bytes) -> None:
        try:
            while data:
                data = data[os.write(self._file, data):]
            if time.monotonic() - self._synced > SYNC_EVERY:
                os.fsync(self._file)
                self._synced = time.monotonic()
        except OSError as e:
            raise InputError(self.path, f"cannot be written ({e.strerror}); what came before is kept") from None


def read_journal(path: str | Path) -> Iterator[Entry]:
    """Entries of a journal; one that is cut at the end is left out. InputError where the file is none."""
    path = Path(path)
    try:
        file = path.open("rb")
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None
    with file:
        if file.read(len(MAGIC)) != MAGIC:
            raise InputError(path, "not a recording cut short; expected a file that `workbench record` left behind")
        while len(head := file.read(_ENTRY.size)) == _ENTRY.size:
            kind, size, arrival = _ENTRY.unpack(head)
            content = file.read(size)
            if len(content) < size:
                return
            yield Entry(kind, arrival, content)
