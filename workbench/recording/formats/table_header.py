"""The line of a table that names its columns, below any comments."""

from __future__ import annotations

from dataclasses import dataclass

from workbench.files.numerals import number_of
from workbench.files.tables import split_row
from workbench.recording.formats.numbers import Bytes

_OWN = b"# workbench"
"""First lines of tables that the workbench writes: they state the kind and are not comments."""
_MOST = 200
"""Maximum number of comment lines before the header."""


@dataclass(frozen=True)
class TableHeader:
    """names: of the columns. end: bytes before the first row of data. lines: rows of the file before it."""

    names: tuple[str, ...]
    end: int
    lines: int

    @property
    def index(self) -> bool:
        """Whether the first column is a nameless count of rows, as pandas writes it."""
        return len(self.names) > 1 and self.names[0] in ("", "Unnamed: 0")


def table_header(content: Bytes) -> TableHeader:
    """The first line of a table that is neither blank nor a comment (#); for a table whose comments are followed directly by
    numbers, the last comment, as numpy writes its header."""
    at = lines = 0
    named: TableHeader | None = None
    while at < len(content) and lines < _MOST:
        end = content.find(b"\n", at)
        line = bytes(content[at:end if end >= 0 else len(content)])
        start, at, lines = at, len(content) if end < 0 else end + 1, lines + 1
        text = line.decode("utf-8-sig", "replace").strip()
        if start == 0 and line.removeprefix(b"\xef\xbb\xbf").startswith(_OWN):
            return TableHeader(tuple(split_row(text)), at, lines)
        if text.startswith("#"):
            named = TableHeader(tuple(split_row(text.lstrip("# "))), at, lines)
        elif text:
            cells = split_row(text)
            if named and len(named.names) == len(cells) and all(number_of(c) is not None for c in cells if c):
                return TableHeader(named.names, start, lines - 1)
            return TableHeader(tuple(cells), at, lines)
    return named or TableHeader((), len(content), lines)
