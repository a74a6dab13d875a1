"""Tables in an unusual layout: why they cannot be read, and how to repair them."""

from __future__ import annotations

import re
from collections.abc import Sequence

from workbench.files.numerals import number_of
from workbench.files.tables import is_binary, split_row

_MOST = 60
"""Number of lines that are searched for a header."""
_SEPARATORS = ((",", "commas"), (";", "';'"), ("\t", "tabs"), ("|", "'|'"), (None, "blanks"))


def odd_table(head: bytes) -> str | None:
    """Cause and remedy for a text that begins with `head` and cannot be read as a table; None if the cause is unknown."""
    if is_binary(head):
        return _odd_bytes(head)
    text = head.decode("utf-8-sig", "replace")
    lines = [line for line in text.splitlines() if line.strip()]
    if not lines:
        return "the file holds blank lines alone"
    if lines[0].lstrip().startswith("{") and len(lines) > 1 and lines[1].lstrip().startswith("{"):
        return "JSON lines, one object for each row: write CSV with pandas' read_json(FILE, lines=True).to_csv(..., index=False)"
    if long_table(split_row(lines[0])):
        return ("a table with one number in each row: give each channel a column, with pandas' pivot(index='time', columns=..., "
                "values='value')")
    return _header_below(text.splitlines()) or _find_transposed(lines)


def long_table(names: Sequence[str]) -> bool:
    """Whether a header belongs to a table with one number in each row: time, the channel's name, its value."""
    lower = {name.lower() for name in names}
    kinds = {"variable", "name", "channel", "signal", "joint", "topic", "key"}
    return 3 <= len(lower) <= 4 and "value" in lower and bool(lower & kinds)


def _odd_bytes(head: bytes) -> str | None:
    """Cause and remedy for a text file that contains NUL bytes."""
    quarter = max(len(head) // 4, 1)
    ends = {k: head[k:4 * quarter:4].count(0) / quarter for k in range(4)}
    if sum(share > 0.9 for share in ends.values()) == 3:
        return "text in UTF-32; save it as UTF-8"
    if min(ends[1], ends[3]) > 0.9 or min(ends[0], ends[2]) > 0.9:
        return "text in UTF-16 without its byte order mark; save it as UTF-8"
    first = head.find(b"\0")
    before = head[:first]
    readable = sum(32 <= b < 127 or b in b"\r\n\t" for b in before)
    if first > 200 and readable > 0.97 * first and b"\n" in before:
        line = before.count(b"\n") + 1
        return (f"line {line}: bytes that are no text (NUL), the first at byte {first}: the disk or card was not written to the "
                "end, or the power went; delete them and keep the whole rows")
    return None


def _header_below(lines: list[str]) -> str | None:
    """Cause and remedy for a table whose header is below other lines, or whose cells are separated by another character."""
    for n, line in enumerate(lines[:_MOST]):
        for mark, name in _SEPARATORS:
            cells = split_row(line) if mark == "," else [c.strip().strip('"') for c in line.strip(" |").split(mark)]
            if len(cells) < 2 or not _names_a_log(cells):
                continue
            above = f"line {n + 1} is the header: delete the {n} line(s) above it" if n else ""
            other = f"{name} between the columns: write commas" if name in ("'|'", "blanks") else ""
            return "; ".join(text for text in (above, other) if text) or None
    return None


def _names_a_log(cells: list[str]) -> bool:
    lower = [c.lower() for c in cells]
    return any(re.fullmatch(r"time.*|t|timestamp.*|frame", c) for c in lower) and \
        any(re.search(r"goal|position|action|command|target|\.q[wxyz]$", c) for c in lower)


def _find_transposed(lines: list[str]) -> str | None:
    rows = [split_row(line) for line in lines[:4]]
    names = sum(number_of(row[0]) is None for row in rows)
    numbers = all(len(row) > 8 and all(number_of(c) is not None for c in row[1:] if c) for row in rows)
    if len(rows) > 2 and names == len(rows) and numbers:
        return "a table with its channels in rows: transpose it, one column for each channel"
    return None
