"""Journal of commands and readings while a motion plays, appended line by line, so that it survives any end of the program."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from workbench.files import InputError

KIND = "workbench play journal 1"


class PlayJournal:
    """Appends; a file of that name must not be there."""

    def __init__(self, path: Path, head: Mapping[str, Any]) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        except FileExistsError:
            raise InputError(path, "left by a motion that was cut short; finish it with `workbench play --finish`, or move it "
                                   "away") from None
        except OSError as e:
            raise InputError(path, f"cannot be written ({e.strerror})") from None
        self.write(kind=KIND, **head)

    def __enter__(self) -> PlayJournal:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def write(self, **entry: Any) -> None:
        """One line."""
        line = (json.dumps(entry) + "\n").encode()
        try:
            while line:
                line = line[os.write(self._file, line):]
        except OSError as e:
            raise InputError(self.path, f"cannot be written ({e.strerror})") from None

    def close(self) -> None:
        """On the disk, and closed."""
        if self._file >= 0:
            os.fsync(self._file)
            os.close(self._file)
            self._file = -1


def read_play_journal(path: str | Path) -> Iterator[dict[str, Any]]:
    """Its lines, the head first; one that is cut at the end is left out. InputError where the file is none."""
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as e:
        raise InputError(path, f"cannot be read ({e})") from None
    try:
        head = json.loads(lines[0]) if lines else {}
    except ValueError:
        head = {}
    if not isinstance(head, dict) or head.get("kind") != KIND:
        raise InputError(path, "not left behind by `workbench play`")
    yield head
    for n, line in enumerate(lines[1:], start=2):
        try:
            yield json.loads(line)
        except ValueError:
            if n < len(lines):
                raise InputError(path, f"line {n}: damaged") from None
