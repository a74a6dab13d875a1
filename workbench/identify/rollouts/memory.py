"""Cached rollouts: in memory up to a number of bytes, and in a folder, so that a killed run resumes.

In the folder each process appends to a file of its own, which others read when they begin, so that two runs may share a folder.
A record is a header (digest of the key, bytes a number, rows, columns, checksum) and the numbers; a record that was not written
to its end ends its file.
"""

from __future__ import annotations

import hashlib
import os
import struct
import uuid
import weakref
import zlib
from collections import OrderedDict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Answer = NDArray[Any]
"""Channels (N, c) of one rollout, float32 or float64."""
SUFFIX = ".rollouts"
_HEADER = struct.Struct("<32sBIII")
_TYPES: dict[int, type[np.floating[Any]]] = {4: np.float32, 8: np.float64}


class _Place(NamedTuple):
    """Where a record is on disk: an open file, where its numbers begin, their type and shape, and their checksum."""

    file: int
    at: int
    size: int
    shape: tuple[int, int]
    checksum: int


class RolloutMemory:
    """Answers by key. most_bytes: held in memory, those used last; others are read again from the folder, or, without one, are
    gone. rollouts, work: distinct rollouts that were requested, and seconds of a puppy's at the search's step, whether they were
    remembered or not, so that a run that was resumed counts like any other; played: those that were really rolled out.

    Not for several threads at once."""

    def __init__(self, folder: Path | None, most_bytes: int) -> None:
        self.folder = folder
        self.rollouts = 0
        self.played = 0
        self.work = 0.0
        self._most, self._bytes = most_bytes, 0
        self._held: OrderedDict[bytes, Answer] = OrderedDict()
        self._requested: set[bytes] = set()
        self._places: dict[bytes, _Place] = {}
        self._written: int | None = None
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            for path in sorted(folder.glob(f"*{SUFFIX}")):
                self._read(path)

    def request(self, key: str, work: float) -> None:
        """Counts a rollout, and its work, when it is requested for the first time."""
        digest = _digest(key)
        if digest not in self._requested:
            self._requested.add(digest)
            self.rollouts += 1
            self.work += work

    def get(self, key: str) -> Answer | None:
        """An answer, where it is known."""
        digest = _digest(key)
        if digest in self._held:
            self._held.move_to_end(digest)
            return self._held[digest]
        place = self._places.get(digest)
        if place is None:
            return None
        content = os.pread(place.file, place.size * place.shape[0] * place.shape[1], place.at)
        if zlib.crc32(content) != place.checksum:  # a file that the disk did not keep
            del self._places[digest]
            return None
        answer = np.frombuffer(content, dtype=_TYPES[place.size]).reshape(place.shape)
        self._hold(digest, answer)
        return answer

    def keep(self, key: str, answer: Answer) -> None:
        """Keeps an answer, on disk before it returns."""
        digest = _digest(key)
        answer = np.ascontiguousarray(answer)
        answer.setflags(write=False)
        self.played += 1
        self._hold(digest, answer)
        if self.folder is None:
            return
        if self._written is None:
            path = self.folder / f"{os.getpid()}-{uuid.uuid4().hex}{SUFFIX}"
            self._written = self._open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL)
        content = answer.tobytes()
        rows, columns = answer.shape
        checksum = zlib.crc32(content)
        at = os.lseek(self._written, 0, os.SEEK_END)
        record = memoryview(_HEADER.pack(digest, answer.itemsize, rows, columns, checksum) + content)
        while record:
            record = record[os.write(self._written, record):]
        self._places[digest] = _Place(self._written, at + _HEADER.size, answer.itemsize, (rows, columns), checksum)

    def _hold(self, digest: bytes, answer: Answer) -> None:
        self._bytes += answer.nbytes - (self._held.pop(digest).nbytes if digest in self._held else 0)
        self._held[digest] = answer
        while self._bytes > self._most and len(self._held) > 1:
            self._bytes -= self._held.popitem(last=False)[1].nbytes

    def _read(self, path: Path) -> None:
        """Places of the records of a file."""
        file = self._open(path, os.O_RDONLY)
        at, end = 0, os.fstat(file).st_size
        while len(header := os.pread(file, _HEADER.size, at)) == _HEADER.size:
            digest, size, rows, columns, checksum = _HEADER.unpack(header)
            at += _HEADER.size
            if size not in _TYPES or at + size * rows * columns > end:
                break
            self._places[digest] = _Place(file, at, size, (rows, columns), checksum)
            at += size * rows * columns

    def _open(self, path: Path, flags: int) -> int:
        file = os.open(path, flags, 0o666)
        weakref.finalize(self, os.close, file)
        return file


def _digest(key: str) -> bytes:
    return hashlib.sha256(key.encode()).digest()
