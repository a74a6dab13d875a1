"""Excel workbooks (xlsx): the first sheet that is a recording, read as if it had been saved as CSV."""

from __future__ import annotations

import tempfile
import zipfile
from dataclasses import replace
from pathlib import Path

from workbench.files import InputError
from workbench.files.reading import regular_file
from workbench.files.tables import plain_head
from workbench.recording.formats.registry import RecordingFormat, format_of
from workbench.recording.recording import Recording

_MOST, _MOST_UNPACKED = 64 << 20, 512 << 20
"""Largest size of the file, and of its unpacked content [bytes], whose sheets are all read into memory at once."""
_DAMAGED = (OSError, ValueError, KeyError, zipfile.BadZipFile, EOFError, IndexError, TypeError, AttributeError)


def matches(head: bytes) -> bool:
    """Whether it is an archive that begins like an Office file."""
    return head.startswith(b"PK\x03\x04") and (b"[Content_Types].xml" in head[:200] or b"xl/" in head[:2000])


def read_excel(path: Path) -> Recording:
    """Reads the first sheet whose header is that of a known format. InputError where the workbook is damaged or
    no sheet is one."""
    import pandas as pd

    source = str(path)
    try:
        with zipfile.ZipFile(regular_file(path, _MOST)) as packed:
            if sum(entry.file_size for entry in packed.infolist()) > _MOST_UNPACKED:
                raise InputError(source, "an Excel workbook that is too large when unpacked; save the sheet as CSV")
        sheets = pd.read_excel(path, sheet_name=None, header=None, engine="openpyxl")
    except InputError:
        raise
    except _DAMAGED as e:
        raise InputError(source, f"an Excel workbook that is damaged ({' '.join(str(e).split())[:120]}); save the sheet as "
                                 f"CSV") from None
    with tempfile.TemporaryDirectory() as folder:
        for n, (name, sheet) in enumerate(sheets.items()):
            table = Path(folder) / f"sheet{n}.csv"
            sheet.to_csv(table, header=False, index=False)
            known = format_of(plain_head(table))
            if known is None:
                continue
            try:
                read = known.read(table)
            except InputError as e:
                raise InputError(source, f"sheet '{name}': {e.problem}") from None
            return replace(read, source=source, metadata={**read.metadata, "written with": f"Excel, sheet '{name}'"})
        from workbench.recording.formats.foreign import refusal

        first = Path(folder) / "sheet0.csv"
        raise InputError(source, f"first sheet: {refusal(first, plain_head(first)).problem}")


FORMAT = RecordingFormat("excel", "an Excel workbook (xlsx)", matches, read_excel)
