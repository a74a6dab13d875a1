"""Reads the data rows of CSV files as columns with the fastest available reader, and locates errors in them."""

from __future__ import annotations

import io
import mmap
import re
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import compute as arrow_compute
from pyarrow import csv as arrow_csv

from workbench.files import InputError
from workbench.files.errors import MistypedError
from workbench.files.numerals import number_of
from workbench.files.reading import MOST_TEXT, regular_file
from workbench.files.tables import HEAD, plain_table, split_row
from workbench.types import Array

Bytes = bytes | mmap.mmap
_BLOCK = 1 << 22
"""Bytes read at once; a smaller file is read faster by one thread than by several."""
_CLOCK = re.compile(r"\d{4}-\d\d-\d\d|\d\d?:\d\d")
"""How dates and times of day are written."""
_BLANK = ["", " ", "NaN", "nan", "NA", "N/A", "#N/A", "null", "NULL", "None"]
"""How a missing value is written, by spreadsheets, R, pandas, JSON and Python among others."""


def map_file(path: str | Path) -> mmap.mmap:
    """The bytes of a file, mapped, not copied; InputError where it is empty or cannot be read."""
    try:
        with regular_file(path).open("rb") as file:
            file.seek(0, 2)
            if file.tell() == 0:
                raise InputError(path, "the file is empty")
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None


def table_bytes(path: str | Path) -> tuple[Bytes, str]:
    """The bytes of a table made plain (`plain_table`), mapped if the file is plain already, and how it was written if not."""
    mapped = map_file(path)
    written = plain_table(mapped[:HEAD])[1]
    if not written:
        return mapped, ""
    if len(mapped) > MOST_TEXT:
        raise InputError(path, f"{written}: more than {MOST_TEXT >> 20} MB are read in UTF-8 with commas alone")
    return plain_table(mapped[:])[0], written


def read_columns(source: str, content: Bytes, offset: int, lines: int, width: int, text: Collection[int] = (),
                 wanted: Collection[int] | None = None) -> pa.Table:
    """Rows from byte `offset` on, `lines` lines into the file, `width` cells each; columns are named "0", "1", ….

    Numbers as float64, columns in `text` as strings, blank cells as null; only `wanted` columns are converted. InputError
    names the line of a short row, of a cell that is no number, or says that there is no row.
    """
    body = pa.py_buffer(memoryview(content)[offset:])
    if len(body) == 0:
        raise InputError(source, f"line {lines + 1}: expected at least one row of data")
    names = [str(i) for i in range(width)]
    kept = names if wanted is None else [str(i) for i in sorted(wanted)]
    types = {n: pa.string() if int(n) in text else pa.float64() for n in kept}
    try:
        table = arrow_csv.read_csv(
            pa.BufferReader(body),
            read_options=arrow_csv.ReadOptions(column_names=names, block_size=_BLOCK, use_threads=len(body) > _BLOCK),
            convert_options=arrow_csv.ConvertOptions(column_types=types, include_columns=kept, null_values=_BLANK,
                                                     strings_can_be_null=True))
    except pa.ArrowInvalid as e:
        where = _where_broken(source, content, offset, lines, width, text)
        raise where or InputError(source, f"after line {lines}: {e}") from None
    if table.num_rows == 0:
        raise InputError(source, f"line {lines + 1}: expected at least one row of data")
    for name, kind in types.items():
        column_of = table.column(name)
        if kind == pa.float64() and arrow_compute.any(arrow_compute.is_inf(column_of)).as_py():
            where = _where_broken(source, content, offset, lines, width, text)
            raise where or InputError(source, f"column {int(name) + 1}: expected finite numbers")
    return table


def _where_broken(source: str, content: Bytes, offset: int, lines: int, width: int, text: Collection[int]
                  ) -> InputError | None:
    """The first row that is not as wide as the header or not numeric; searched for only after the fast reader has failed."""
    n = lines
    while offset < len(content):
        end = content.find(b"\n", offset)
        last = end < 0
        line = content[offset:len(content) if last else end]
        offset, n = len(content) if last else end + 1, n + 1
        row = split_row(line.decode("utf-8", "replace"))
        if not any(row):
            continue
        if len(row) != width:
            return InputError(source, f"line {n}: {len(row)} of {width} columns{_why_width(row, width, last)}")
        for i, cell in enumerate(row):
            if i not in text and cell not in _BLANK and number_of(cell) is None:
                error = MistypedError if cell.strip().isalpha() else InputError
                return error(source, f"line {n}, column {i + 1}: expected a number, got '{cell[:40]}'{_why_word(row, cell)}")
    return None


def _why_width(row: list[str], width: int, last: bool) -> str:
    """The likely cause of a row that is not as wide as the header, and the remedy."""
    if len(row) == 1 and number_of(row[0]) is None:
        return f" ('{row[0][:40]}': text among the rows; delete the line)"
    if len(row) == width + 1 and not row[-1]:
        return " (a comma at the end of the row: delete it)"
    if len(row) in (2 * width, 2 * width - 1, 2 * width - 2, 2 * width - 3) or len(row) > 1.5 * width:
        return " (decimal commas between commas? Write decimal points, or ; between the columns)"
    return "; the file is cut mid-row" if last and len(row) < width else ""


def _why_word(row: list[str], cell: str) -> str:
    """The likely cause of a cell that is not a number, and the remedy; empty if unknown."""
    if len(row) > 1 and all(re.match(r"[\[(]?[A-Za-z_%°]", c) for c in row):
        units = all(len(c.strip("[]()")) <= 6 for c in row)
        return " (a row of units: delete the line)" if units else " (a second header: two logs in one file? Delete it or split)"
    hints = ((_CLOCK, "a date or time of day: write seconds since the first row"),
             (re.compile(r"[\u2010-\u2015\u2212]"), "a dash that is no minus sign: write -"),
             (re.compile(r"[-+]?\d+,\d+"), "a decimal comma: write a decimal point"),
             (re.compile(r"[-+]?\d{1,3}([,'\u2019\u00a0 ]\d{3})+([.,]\d*)?"), "write it without separators of thousands"),
             (re.compile(r"(?i)[-+]?\d*\.?\d+d[-+]?\d+"), "Fortran's exponent: write E"),
             (re.compile(r"[-+]?[\d.]+(e[-+]?\d+)?\s*[^\d\s.,'-]+"), "a number with its unit: write the number alone"),
             (re.compile(r"[-?*.x]+|(?i:[-+]?inf(inity)?|missing|error|invalid|timeout)"),
              "leave the cell blank where nothing was measured"))
    return next((f" ({text})" for pattern, text in hints
                 if (pattern.search(cell) if pattern is _CLOCK else pattern.match(cell) if "dash" in text
                     else pattern.fullmatch(cell.strip()))), "")


def column(table: pa.Table, index: int) -> Array:
    """One column of numbers (N,), NaN where blank."""
    return np.asarray(table.column(str(index)).to_numpy(), dtype=float)


def strings(table: pa.Table, index: int) -> list[str]:
    """One column of text, empty where blank."""
    return [v or "" for v in table.column(str(index)).to_pylist()]


def stack_columns(table: pa.Table, columns: Sequence[int]) -> Array:
    """Columns as rows of one array (len(columns), N), filled chunk by chunk without a second copy."""
    out = np.empty((len(columns), table.num_rows))
    for row, index in zip(out, columns):
        at = 0
        for chunk in table.column(str(index)).chunks:
            row[at:at + len(chunk)] = chunk.to_numpy(zero_copy_only=False)  # nulls arrive as NaN
            at += len(chunk)
    return out


def rate_of(time: Array) -> float:
    """Samples per second of nearly even times (N,) [s]; NaN if they are not."""
    steps = np.diff(time)
    if not len(steps):
        return float("nan")
    middle = float(np.median(steps))
    even = middle > 0 and np.mean((steps > middle / 2) & (steps < 2 * middle)) > 0.95
    return float((len(time) - 1) / (time[-1] - time[0])) if even else float("nan")


def number_columns(path: str | Path, text: str, first_line: int, skip_blank: bool = False) -> dict[str, Array]:
    """Columns by name of a table that the workbench wrote: a header, then numbers; a blank cell is NaN, a line that is too short
    or too long an InputError. first_line: of the file, on which `text` begins. skip_blank: blank lines do not count."""
    header = text.partition("\n")[0]
    width = header.count(",")
    if '"' in header:
        raise InputError(path, f"line {first_line}: expected names of columns without quotes")
    for i, line in enumerate(text.splitlines()):
        if line.count(",") != width and not (skip_blank and not line):
            raise InputError(path, f"line {i + first_line}: expected {width + 1} cells, got {line.count(',') + 1}")
    import pandas as pd

    try:
        table = pd.read_csv(io.StringIO(text), dtype=float, keep_default_na=False, na_values=[""], index_col=False)
    except ValueError as e:  # pandas' parser errors among them
        raise InputError(path, f"expected numbers below the header ({str(e).strip()})") from None
    return {str(c): table[c].to_numpy() for c in table.columns}
