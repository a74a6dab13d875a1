"""Writer of Motive CSV files, in the layout of version 1.23 with quaternions."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import csv as arrow_csv

from workbench.files.reading import write_whole
from workbench.recording.body_track import BodyTrack

_UNITS = {"Meters": 1.0, "Centimeters": 100.0, "Millimeters": 1000.0}
_DIGITS = 6  # as Motive writes


def write_motive(path: str | Path, bodies: Mapping[str, BodyTrack], rate: float, *, units: str = "Meters", take_name: str = "",
                 first_frame: int = 0, metadata: Mapping[str, str] | None = None) -> Path:
    """Writes rigid bodies (paths in the capture's axes, metres, quaternions wxyz) atomically; NaN becomes a blank cell.

    rate [Hz], also that of the header. units: "Meters", "Centimeters" or "Millimeters". metadata: of another file, from which
    date and coordinates are taken.
    """
    if units not in _UNITS:
        raise ValueError(f"units: expected one of {', '.join(_UNITS)}, got {units!r}")
    count = len(next(iter(bodies.values())).p) if bodies else 0
    known = dict(metadata or {})
    head = {
        "Format Version": "1.23", "Take Name": take_name or Path(path).stem, "Take Notes": known.get("Take Notes", ""),
        "Capture Frame Rate": f"{rate:.6f}", "Export Frame Rate": f"{rate:.6f}",
        "Capture Start Time": known.get("Capture Start Time", ""), "Total Frames in Take": str(count),
        "Total Exported Frames": str(count), "Rotation Type": "Quaternion", "Length Units": units,
        "Coordinate Space": known.get("Coordinate Space", "Global"),
    }
    text = io.StringIO()
    write = csv.writer(text, lineterminator="\n").writerow
    write([cell for pair in head.items() for cell in pair])
    text.write("\n")
    each = [(name, f"{i + 1:032X}") for i, name in enumerate(bodies) for _ in range(8)]
    write(["", "Type", *["Rigid Body"] * len(each)])
    write(["", "Name", *[name for name, _ in each]])
    write(["", "ID", *[number for _, number in each]])
    write(["", "", *(["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"]) * len(bodies)])
    write(["Frame", "Time (Seconds)", *[*"XYZWXYZ", ""] * len(bodies)])
    frames = np.arange(count)
    columns = [pa.array(frames + first_frame), pa.array(np.round(frames / rate, _DIGITS))]
    for body in bodies.values():
        error = np.full(count, np.nan) if body.error is None else body.error
        rows = [*body.quat[:, [1, 2, 3, 0]].T, *(body.p * _UNITS[units]).T, error * _UNITS[units]]
        columns += [pa.array(np.round(row, _DIGITS), from_pandas=True) for row in rows]  # NaN becomes null, null a blank
    out = pa.BufferOutputStream()
    out.write(text.getvalue().encode())
    arrow_csv.write_csv(pa.table(columns, names=[str(i) for i in range(len(columns))]), out,
                        arrow_csv.WriteOptions(include_header=False, quoting_style="none"))
    return write_whole(path, out.getvalue().to_pybytes())
