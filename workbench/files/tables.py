"""Normalises tables from spreadsheets and old computers: UTF-8, LF, commas between cells, points in numbers."""

from __future__ import annotations

import csv
from pathlib import Path

from workbench.files.errors import InputError
from workbench.files.reading import MOST_TEXT, regular_file

HEAD = 1 << 16
"""Bytes from which a file's kind and encoding are determined."""
_UTF16 = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}


def plain_table(content: bytes) -> tuple[bytes, str]:
    """The table made plain, and how it was written where that was not plain already (else an empty text).

    UTF-16 with its mark becomes UTF-8; lone CR become line ends; `;` or tabs between the cells of the first line become commas,
    and commas in numbers points.
    """
    changes = []
    encoding = _UTF16.get(content[:2])
    if encoding:
        content = content[2:].decode(encoding, "replace").encode("utf-8", "replace")
        changes.append("UTF-16")
    head = content[:HEAD]
    if b"\r" in head and b"\n" not in head:
        content = content.replace(b"\r", b"\n")
        changes.append("lines that end in CR")
    first = next((line for line in content[:HEAD].split(b"\n") if line.strip() and not line.startswith(b"#")), b"")
    for cell, name in ((b";", "';'"), (b"\t", "tabs")):
        if first.count(cell) > first.count(b",") and first.count(cell) >= _cells_least(first, cell):
            content = content.replace(b",", b".").replace(cell, b",")
            changes.append(f"{name} between cells")
            break
    return content, ", ".join(changes)


def _cells_least(first: bytes, cell: bytes) -> int:
    """A single separator counts only between words that occur in a table's header."""
    words = [w.strip().strip(b'"').lower() for w in first.split(cell)]
    return 1 if words[0] in (b"time", b"frame", b"format version", b"timestamp", b"t") else 3


def is_binary(head: bytes) -> bool:
    """Whether a file that begins with `head` is no text in any code page that tables are written in."""
    return b"\0" in head and head[:2] not in _UTF16


def plain_head(path: str | Path) -> bytes:
    """The beginning of a file, made plain where it is text; InputError where it cannot be read."""
    try:
        with regular_file(path).open("rb") as file:
            head = file.read(HEAD)
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None
    return head if is_binary(head) else plain_table(head)[0]


def plain_text(path: str | Path) -> str:
    """A table as plain text; InputError where it cannot be read or is no text."""
    try:
        content, _ = plain_table(regular_file(path, MOST_TEXT).read_bytes())
        return content.decode("utf-8-sig")
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None
    except UnicodeDecodeError as e:
        raise InputError(path, f"byte {e.start}: not a text file in UTF-8") from None


def split_row(line: str) -> list[str]:
    """Cells of one row, stripped; a quote that does not end, or another stray character, is taken as it stands."""
    try:
        return [cell.strip() for cell in next(csv.reader([line.replace("\r", " ")]), [])]
    except csv.Error:
        return [cell.strip() for cell in line.split(",")]
