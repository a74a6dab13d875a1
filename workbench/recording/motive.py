"""Reader of Motive CSV exports, versions 1.20 to 1.25."""

from __future__ import annotations

import csv
import mmap
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import csv as arrow_csv

from workbench.recording.motive_header import Asset, MotiveHeader, euler_order, metres_per_unit, number, parse_header
from workbench.recording.quaternions import from_euler
from workbench.recording.recording import Recording
from workbench.recording.take import BodyTrack
from workbench.robot import InputError

Array = NDArray[np.float64]
_BODIES = ("Rigid Body", "Bone")


def read_motive(path: str | Path) -> Recording:
    """Reads a Motive CSV (OptiTrack, "Data Export: CSV") in one pass over the file.

    Time is (frame - first frame) / export rate; lengths become metres; quaternions are stored wxyz, as the file has
    them, sign included; Euler angles (intrinsic, degrees, in the order that the header names) become quaternions; blank cells
    are NaN. InputError names the line where a file is cut or holds what is no number.
    """
    source = str(path)
    try:
        with open(path, "rb") as file:
            if Path(path).stat().st_size == 0:
                raise InputError(source, "the file is empty; expected a Motive export")
            mapped = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as e:
        raise InputError(source, f"cannot be read ({e.strerror})") from None
    header = parse_header(source, memoryview(mapped))
    scale = metres_per_unit(source, header)
    table = _read_body(source, mapped, header)
    count = table.num_rows
    if count == 0:
        raise InputError(source, f"line {header.lines + 1}: expected at least one frame after the header")
    frames = _frames(source, header, table)
    problems: list[str] = []
    rate = _rate(source, header, table, frames, problems)
    problems += _missing(source, header, mapped, frames)
    bodies: dict[str, BodyTrack] = {}
    markers: dict[str, Array] = {}
    for asset in header.assets:
        if asset.kind in _BODIES and (asset.rotation or asset.position):
            bodies[_unused(asset.name, bodies, "")] = _track(source, header, asset, table, scale)
        elif asset.position:
            markers[_unused(asset.name, markers, asset.kind)] = _columns(table, asset.position, "XYZ").T * scale
    metadata = dict(header.metadata)
    metadata |= {f"Parent of {child}": parent for child, parent in header.parents.items()}
    if header.timecode is not None:
        metadata["First TimeCode"] = str(table.column(str(header.timecode))[0].as_py() or "")
    if "Length Units" not in metadata:
        problems.append("the header does not say the length units; metres are assumed")
    return Recording(source=source, kind="motive", version=header.version, time=(frames - frames[0]) / rate, frames=frames, rate=rate,
                     units=metadata.get("Length Units", "Meters"), rigid_bodies=bodies, markers=markers, metadata=metadata,
                     problems=tuple(problems))


def _read_body(source: str, mapped: mmap.mmap, header: MotiveHeader) -> pa.Table:
    names = [str(i) for i in range(header.columns)]
    wanted = {0, 1} if header.columns > 1 else {0}
    for a in header.assets:
        wanted |= set(a.rotation.values()) | set(a.position.values()) | ({a.error} - {None})  # type: ignore[arg-type]
    types = {str(i): pa.float64() for i in wanted}
    if header.timecode is not None:
        wanted.add(header.timecode)
        types[str(header.timecode)] = pa.string()
    body = pa.py_buffer(memoryview(mapped)[header.offset:])
    if len(body) == 0:
        raise InputError(source, f"line {header.lines + 1}: expected at least one frame after the header")
    try:
        return arrow_csv.read_csv(
            pa.BufferReader(body),
            read_options=arrow_csv.ReadOptions(column_names=names, block_size=1 << 22),
            convert_options=arrow_csv.ConvertOptions(
                column_types=types, include_columns=sorted(names, key=int) if len(wanted) == len(names) else
                [n for n in names if int(n) in wanted], strings_can_be_null=True, null_values=["", " ", "NaN", "nan"]))
    except pa.ArrowInvalid as e:
        raise InputError(source, _where_broken(mapped, header) or f"after line {header.lines}: {e}") from None


def _where_broken(mapped: mmap.mmap, header: MotiveHeader) -> str | None:
    """The first line that is not a row of numbers as wide as the header; looked for only once the fast reader has failed."""
    text = mapped[header.offset:].decode("utf-8", "replace").splitlines()
    for n, row in enumerate(csv.reader(text), start=header.lines + 1):
        if not any(c.strip() for c in row):
            continue
        if len(row) != header.columns:
            cut = n == header.lines + len(text)
            return f"line {n}: {len(row)} of {header.columns} columns" + ("; the file is cut mid-row" if cut else "")
        for i, cell in enumerate(row):
            try:
                if i != header.timecode and cell.strip():
                    float(cell)
            except ValueError:
                return f"line {n}, column {i + 1}: expected a number, got '{cell[:40]}'"
    return None


def _numbers(table: pa.Table, column: int) -> Array:
    return np.asarray(table.column(str(column)).to_numpy(), dtype=float)


def _columns(table: pa.Table, columns: dict[str, int], letters: str) -> Array:
    """(len(letters), N), filled column by column without a second copy."""
    out = np.empty((len(letters), table.num_rows))
    for row, letter in zip(out, letters):
        at = 0
        for chunk in table.column(str(columns[letter])).chunks:
            row[at:at + len(chunk)] = chunk.to_numpy(zero_copy_only=False)  # nulls arrive as NaN
            at += len(chunk)
    return out


def _track(source: str, header: MotiveHeader, asset: Asset, table: pa.Table, scale: float) -> BodyTrack:
    count = table.num_rows
    if not asset.rotation:
        quat = np.full((count, 4), np.nan)
    elif "W" in asset.rotation:
        quat = _columns(table, asset.rotation, "WXYZ").T
    else:
        angles = np.deg2rad(_columns(table, asset.rotation, "XYZ"))
        quat = from_euler(dict(zip("XYZ", angles)), euler_order(source, header))
    p = _columns(table, asset.position, "XYZ") if asset.position else np.full((3, count), np.nan)
    if scale != 1:
        p *= scale
    error = None if asset.error is None else _columns(table, {"E": asset.error}, "E")[0] * scale
    return BodyTrack(p=p.T, quat=quat, error=error)


def _frames(source: str, header: MotiveHeader, table: pa.Table) -> NDArray[np.int64]:
    frames = _numbers(table, 0)
    bad = ~np.isfinite(frames)
    bad[1:] |= ~(np.diff(frames) > 0)
    if bad.any():
        n = int(np.argmax(bad))
        raise InputError(source, f"line {header.lines + 1 + n}: frame number {frames[n]:g} does not follow; expected increasing numbers")
    return frames.astype(np.int64)


def _rate(source: str, header: MotiveHeader, table: pa.Table, frames: NDArray[np.int64], problems: list[str]) -> float:
    """Export rate of the header, else capture rate, else from the Time column, which is rounded to a millisecond."""
    rate = number(source, header, "Export Frame Rate") or number(source, header, "Capture Frame Rate")
    if rate is not None:
        return rate
    time = _numbers(table, 1) if header.columns > 1 else np.zeros(1)
    if len(time) < 2 or not time[-1] > time[0]:
        raise InputError(source, "header: no Export Frame Rate, and no times to tell it from")
    problems.append("the header does not say the frame rate; it is taken from the Time column")
    return float((frames[-1] - frames[0]) / (time[-1] - time[0]))


def _missing(source: str, header: MotiveHeader, mapped: mmap.mmap, frames: NDArray[np.int64]) -> list[str]:
    problems = []
    steps = np.diff(frames)
    holes = np.flatnonzero(steps > 1)
    if len(holes):
        lost = int(steps[holes].sum() - len(holes))
        problems.append(f"frames missing: {lost} in {len(holes)} hole(s), the first after frame {frames[holes[0]]}")
    announced = number(source, header, "Total Exported Frames")
    if announced is not None and announced != len(frames):
        if len(frames) < announced and mapped[-1:] != b"\n":  # a cut inside the last cell leaves a row that looks whole
            line = header.lines + len(frames)
            raise InputError(source, f"line {line}: the file ends without a line end, at {len(frames)} of {announced:.0f} frames; it is cut")
        problems.append(f"the header announces {announced:.0f} frames, the file holds {len(frames)}")
    return problems


def _unused(name: str, taken: dict[str, BodyTrack] | dict[str, Array], kind: str) -> str:
    """The name, made different where two assets share one (a solved and a raw marker do)."""
    if name not in taken:
        return name
    name = f"{name} ({kind})" if kind else name
    n, out = 2, name
    while out in taken:
        out, n = f"{name} {n}", n + 1
    return out
