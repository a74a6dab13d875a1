"""Reader of Motive CSV exports, versions 1.20 to 1.25."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from workbench.files import InputError
from workbench.recording.body_track import BodyTrack
from workbench.recording.formats.capture_table import half_turned
from workbench.recording.formats.motive_header import (
    Asset,
    MotiveHeader,
    euler_order,
    looks_like_motive,
    metres_per_unit,
    number,
    parse_header,
    rewritten_orders,
)
from workbench.recording.formats.numbers import Bytes, column, read_columns, stack_columns, table_bytes
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.quaternions import from_euler
from workbench.recording.recording import Recording
from workbench.types import Array

_BODIES = ("Rigid Body", "Bone")
_LARGEST = 1e15  # the largest frame number that a float represents exactly
_LEAP = 100_000  # least leap in frames: a quarter of an hour at 120 Hz, and a hundred times the frames in the file
_FEW = 10  # too few rows to determine the rate
_DISAGREE = 0.01  # allowed difference between the header and the Time column, which is rounded to a millisecond


def read_motive(path: str | Path) -> Recording:
    """Reads a Motive CSV (OptiTrack, "Data Export: CSV") in one pass over the file.

    Time is (frame - first frame) / export rate; lengths become metres; quaternions are stored wxyz, as in the file,
    sign included; Euler angles (intrinsic, degrees, in the order that the header names) become quaternions; blank cells
    are NaN. InputError names the line where a file is cut or contains something other than a number.
    """
    source = str(path)
    mapped, written = table_bytes(path)
    header = parse_header(source, memoryview(mapped))
    scale = metres_per_unit(source, header)
    table = _read_body(source, mapped, header)
    problems = rewritten_orders(header)
    frames = _frames(source, header, table, problems)
    rate = _rate(source, header, table, frames, problems)
    frames, rate = _on_clock(header, table, frames, rate, problems)
    problems += _missing(source, header, mapped, frames)
    bodies: dict[str, BodyTrack] = {}
    markers: dict[str, Array] = {}
    raw = {a.name for a in header.assets if a.kind == "Marker"}
    for asset in header.assets:
        if asset.kind in _BODIES and (asset.rotation or asset.position):
            bodies[_make_unique(asset.name, bodies)] = _track(source, header, asset, table, scale)
        elif asset.position:
            namesake = asset.kind != "Marker" and asset.name in raw  # the raw marker replaces the solved one
            name = _make_unique(f"{asset.name} ({asset.kind})" if namesake else asset.name, markers)
            markers[name] = stack_columns(table, _in_order(asset.position, "XYZ")).T * scale
    problems += _half_turned(source, header, bodies)
    names = [a.name for a in header.assets if a.kind in _BODIES and (a.rotation or a.position)]
    for name in dict.fromkeys(n for n in names if names.count(n) > 1):
        problems.append(f"{names.count(name)} rigid bodies are called '{name}': they cannot be told apart; rename them in "
                        f"Motive and "
                        "export again (the others are called by the name and a number)")
    metadata = dict(header.metadata)
    metadata |= {f"Parent of {child}": parent for child, parent in header.parents.items()}
    if header.timecode is not None:
        metadata["First TimeCode"] = str(table.column(str(header.timecode))[0].as_py() or "")
    if metadata.get("Coordinate Space", "Global").lower() != "global":
        problems.append(f"the header says Coordinate Space {metadata['Coordinate Space']}, poses against each one's parent; "
                        "expected Global, and taken as that")
    if written:
        metadata["written with"] = written
    if "Length Units" not in metadata:
        problems.append("the header does not say the length units; metres are assumed")
    return Recording(source=source, kind="motive", version=header.version, time=(frames - frames[0]) / rate, frames=frames,
                     rate=rate, units=metadata.get("Length Units", "Meters"), rigid_bodies=bodies, markers=markers,
                     metadata=metadata, problems=tuple(problems), sensing="mocap")


def _read_body(source: str, content: Bytes, header: MotiveHeader) -> pa.Table:
    wanted = {0, 1} if header.columns > 1 else {0}
    for a in header.assets:
        wanted |= {*a.rotation.values(), *a.position.values()}
        if a.error is not None:
            wanted.add(a.error)
    text = set() if header.timecode is None else {header.timecode}
    return read_columns(source, content, header.offset, header.lines, header.columns, text, wanted | text)


def _in_order(columns: dict[str, int], letters: str) -> list[int]:
    return [columns[letter] for letter in letters]


def _track(source: str, header: MotiveHeader, asset: Asset, table: pa.Table, scale: float) -> BodyTrack:
    count = table.num_rows
    if not asset.rotation:
        quat = np.full((count, 4), np.nan)
    elif "W" in asset.rotation:
        quat = stack_columns(table, _in_order(asset.rotation, "WXYZ")).T
    else:
        angles = np.deg2rad(stack_columns(table, _in_order(asset.rotation, "XYZ")))
        quat = from_euler(dict(zip("XYZ", angles)), euler_order(source, header))
    p = stack_columns(table, _in_order(asset.position, "XYZ")) if asset.position else np.full((3, count), np.nan)
    if scale != 1:
        p *= scale
    error = None if asset.error is None else column(table, asset.error) * scale
    return BodyTrack(p=p.T, quat=quat, error=error)


def _half_turned(source: str, header: MotiveHeader, bodies: Mapping[str, BodyTrack]) -> list[str]:
    """A line if every body begins turned by half a turn about one axis, as the robot stands in neutral. InputError where the
    header's order of the columns is not Motive's either: then the values are still in Motive's."""
    axis = half_turned([body.quat for body in bodies.values()])
    if axis is None:
        return []
    text = f"every body begins half a turn about {axis} from neutral (W near 0, {axis.upper()} near 1)"
    order = next((order for a in header.assets if (order := a.order("rotation")) not in ("", "XYZW", "XYZ")), None)
    if order is not None:
        raise InputError(source, f"header: Rotation columns are in the order {','.join(order)}, but {text}: are the values still "
                                 "in the order X,Y,Z,W, as Motive writes them?")
    return [f"{text}: are the values in another order than the header's X,Y,Z,W?"]


def _frames(source: str, header: MotiveHeader, table: pa.Table, problems: list[str]) -> NDArray[np.int64]:
    """Frame numbers; a leap of hours is reported and counted as one frame."""
    frames = column(table, 0)
    bad = ~np.isfinite(frames) | (np.abs(frames) > _LARGEST) | (frames != np.round(frames))
    bad[1:] |= ~(np.diff(frames) > 0)
    if bad.any():
        n = int(np.argmax(bad))
        raise InputError(source, f"line {header.lines + 1 + n}: frame {frames[n]:g} does not follow; expected increasing "
                                 "numbers, whole and below 1e15")
    out = frames.astype(np.int64)
    steps = np.diff(out)
    leaps = steps > max(_LEAP, 100 * len(out))
    if leaps.any():
        k = int(np.argmax(leaps))
        problems.append(f"line {header.lines + 2 + k}: frame number leaps from {out[k]} to {out[k + 1]}, which no take has; the "
                        "following rows are taken as the next frames")
    steps = np.where(leaps, 1, steps)
    return np.concatenate([out[:1], out[0] + np.cumsum(steps)])


def _on_clock(header: MotiveHeader, table: pa.Table, frames: NDArray[np.int64], rate: float,
              problems: list[str]) -> tuple[NDArray[np.int64], float]:
    """Frames and rate, corrected by the Time column, which is written frame by frame, if the header disagrees with it."""
    time = column(table, 1) if header.columns > 1 else np.zeros(0)
    good = np.isfinite(time)
    if good.sum() < _FEW or header.timecode == 1:
        return frames, rate
    span, ticks = np.ptp(time[good]), frames[good][-1] - frames[good][0]
    seconds = float(np.median(np.diff(time[good])))
    if seconds <= 0:
        problems.append("the Time column does not increase; times are taken from the frame numbers alone")
    steady = seconds > 0 and np.median(np.abs(np.diff(time[good]) - seconds)) < 0.2 * seconds
    if not steady or not span > 0 or abs(span * rate / ticks - 1) < _DISAGREE:
        return frames, rate
    step = int(np.median(np.diff(frames)))
    if step > 1 and abs(rate * seconds - 1) < 0.1 and np.all(np.diff(frames) % step == 0):
        problems.append(f"frame numbers count every {step} although {rate:g} frames a second are exported; taken as one each, as "
                        "the Time column has it")
        return frames[0] + (frames - frames[0]) // step, rate
    measured = float(ticks / span)
    problems.append(f"the header says {rate:g} frames a second, the Time column {measured:.4g}; the Time column is used")
    return frames, measured


def _rate(source: str, header: MotiveHeader, table: pa.Table, frames: NDArray[np.int64], problems: list[str]) -> float:
    """Export rate of the header, else capture rate, else from the Time column, which is rounded to a millisecond."""
    rate = number(source, header, "Export Frame Rate") or number(source, header, "Capture Frame Rate")
    if rate is not None:
        return rate
    time = column(table, 1) if header.columns > 1 else np.zeros(1)
    if len(time) < 2 or not time[-1] > time[0]:
        raise InputError(source, "header: no Export Frame Rate, and no times to compute it from")
    problems.append("the header does not say the frame rate; it is taken from the Time column")
    return float((frames[-1] - frames[0]) / (time[-1] - time[0]))


def _missing(source: str, header: MotiveHeader, mapped: Bytes, frames: NDArray[np.int64]) -> list[str]:
    problems = []
    steps = np.diff(frames)
    holes = np.flatnonzero(steps > 1)
    if len(holes):
        lost = int(steps[holes].sum() - len(holes))
        problems.append(f"frames missing: {lost} in {len(holes)} hole(s), the first after frame {frames[holes[0]]}")
    announced = number(source, header, "Total Exported Frames")
    if announced is not None and announced != len(frames):
        if len(frames) < announced and mapped[-1:] != b"\n":  # truncated inside the last cell, whose row looks complete
            line = header.lines + len(frames)
            raise InputError(source, f"line {line}: the file is cut, at {len(frames)} of {announced:.0f} frames and no line end")
        problems.append(f"the header announces {announced:.0f} frames, the file holds {len(frames)}")
    return problems


def _make_unique(name: str, taken: Collection[str]) -> str:
    """The name, numbered where two assets share it."""
    out, n = name, 2
    while out in taken:
        out, n = f"{name} {n}", n + 1
    return out


FORMAT = RecordingFormat("motive", "a Motive CSV", looks_like_motive, read_motive)
