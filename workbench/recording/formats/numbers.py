"""Bodies of CSV files as columns, by the fastest reader there is, and where they are broken if they are."""

from __future__ import annotations

import csv
import io
import mmap
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv as arrow_csv

from workbench.robot import InputError

Array = NDArray[np.float64]
_BLANK = ["", " ", "NaN", "nan"]


def map_file(path: str | Path) -> mmap.mmap:
    """The bytes of a file, mapped, not copied; InputError where it is empty or cannot be read."""
    try:
        with open(path, "rb") as file:
            file.seek(0, 2)
            if file.tell() == 0:
                raise InputError(path, "the file is empty")
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as e:
        raise InputError(path, f"cannot be read ({e.strerror})") from None


def read_columns(source: str, content: mmap.mmap, offset: int, lines: int, width: int, text: Collection[int] = (),
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
            read_options=arrow_csv.ReadOptions(column_names=names, block_size=1 << 22),
            convert_options=arrow_csv.ConvertOptions(column_types=types, include_columns=kept, null_values=_BLANK,
                                                     strings_can_be_null=True))
    except pa.ArrowInvalid as e:
        raise InputError(source, _where_broken(content, offset, lines, width, text) or f"after line {lines}: {e}") from None
    if table.num_rows == 0:
        raise InputError(source, f"line {lines + 1}: expected at least one row of data")
    return table


def _where_broken(content: mmap.mmap, offset: int, lines: int, width: int, text: Collection[int]) -> str | None:
    """The first row that is not as wide as the header or not of numbers; looked for only once the fast reader has failed."""
    rows = content[offset:].decode("utf-8", "replace").splitlines()
    for n, row in enumerate(csv.reader(rows), start=lines + 1):
        if not any(c.strip() for c in row):
            continue
        if len(row) != width:
            cut = "; the file is cut mid-row" if n == lines + len(rows) and len(row) < width else ""
            return f"line {n}: {len(row)} of {width} columns{cut}"
        for i, cell in enumerate(row):
            try:
                if i not in text and cell.strip():
                    float(cell)
            except ValueError:
                return f"line {n}, column {i + 1}: expected a number, got '{cell[:40]}'"
    return None


def column(table: pa.Table, index: int) -> Array:
    """One column of numbers (N,), NaN where blank."""
    return np.asarray(table.column(str(index)).to_numpy(), dtype=float)


def strings(table: pa.Table, index: int) -> list[str]:
    """One column of text, empty where blank."""
    return [v or "" for v in table.column(str(index)).to_pylist()]


def stacked(table: pa.Table, columns: Sequence[int]) -> Array:
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
    width = text.partition("\n")[0].count(",")
    for i, line in enumerate(text.splitlines()):
        if line.count(",") != width and not (skip_blank and not line):
            raise InputError(path, f"line {i + first_line}: expected {width + 1} cells, got {line.count(',') + 1}")
    try:
        table = pd.read_csv(io.StringIO(text), dtype=float, keep_default_na=False, na_values=[""], index_col=False)
    except ValueError as e:  # pandas' parser errors among them
        raise InputError(path, f"expected numbers below the header ({str(e).strip()})") from None
    return {str(c): table[c].to_numpy() for c in table.columns}
