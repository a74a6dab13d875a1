"""A file that is written continuously, so that a killed program loses nothing."""

from __future__ import annotations

import math
import os
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from workbench.files.errors import InputError


class AppendedFile:
    """Appends to a new file. if_it_exists: the message of the InputError where a file of that name exists: what it is, and what
    to do with it. sync_every: longest stretch that a power cut may cost [s]; by default only `close` waits for the disk."""

    def __init__(self, path: Path, if_it_exists: str, sync_every: float = math.inf) -> None:
        self.path, self._sync_every, self._synced = path, sync_every, time.monotonic()
        try:
            self._made = [folder for folder in path.parents if not folder.exists()]
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError:
            raise InputError(path, if_it_exists) from None
        except OSError as e:
            raise InputError(path, f"cannot be written ({e.strerror})") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def append(self, data: bytes) -> None:
        """Appends everything; InputError if the disk is full."""
        try:
            while data:
                data = data[os.write(self._file, data):]
            if time.monotonic() - self._synced > self._sync_every:
                os.fsync(self._file)
                self._synced = time.monotonic()
        except OSError as e:
            raise InputError(self.path, f"cannot be written ({e.strerror}); what came before is kept") from None

    def discard(self) -> None:
        """Closes and deletes it, and the folders that were made for it, where nothing else is in them."""
        self.close()
        self.path.unlink(missing_ok=True)
        for folder in self._made:
            with suppress(OSError):  # not empty
                folder.rmdir()

    def close(self) -> None:
        """Flushes to disk and closes."""
        if self._file >= 0:
            os.fsync(self._file)
            os.close(self._file)
            self._file = -1
