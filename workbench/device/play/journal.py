"""Journal of commands and readings while a motion plays, appended line by line, so that it survives any end of the program."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from workbench.files import InputError
from workbench.files.appended import AppendedFile

KIND = "workbench play journal 1"


class PlayJournal(AppendedFile):
    """Appends lines to a new file, of which `head` is the first."""

    def __init__(self, path: Path, head: Mapping[str, Any]) -> None:
        super().__init__(path, "left by a motion that was cut short; finish it with `workbench play --finish`, or move it away")
        self.write(kind=KIND, **head)

    def write(self, **entry: Any) -> None:
        """Writes one line."""
        self.append((json.dumps(entry) + "\n").encode())


def read_play_journal(path: str | Path) -> Iterator[dict[str, Any]]:
    """The journal's lines, the head first; one that is cut at the end is left out. InputError where the file is none."""
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
