"""C3D files of motion capture, read with the package ezc3d: rigid bodies if the file has them, else bodies formed of markers with
a common name."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, Literal

import numpy as np

from workbench.files import InputError
from workbench.files.reading import regular_file
from workbench.recording.formats.capture_table import METRES, Capture, recording_of, rotations
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording

_MARK = 0x50
"""The second byte of every C3D."""
_BLOCK = 512
"""Bytes of a block, by which a C3D counts its sections."""
_MOST_COUNTED = 65535
"""Largest number of a frame in the header, which stands for all beyond it, too."""
_INTEL = 84
"""Processor type of files whose numbers begin with their lowest byte."""
_SLOWEST, _FASTEST = 0.1, 1e5
"""Rates of any camera [frames per second]."""


def matches(head: bytes) -> bool:
    """Recognised by its second byte, and by zeros that no text has."""
    return len(head) >= 512 and head[1] == _MARK and 1 <= head[0] <= 20 and b"\0" in head[:64]


def read_c3d(path: Path) -> Recording:
    """Reads markers [m], and rotations of rigid bodies where the file has any; z is up unless POINT:Y_SCREEN says y. InputError
    where the file is damaged or cut, or its unit, rate or axes cannot be."""
    import ezc3d

    source = str(path)
    regular_file(path)
    try:
        content = ezc3d.c3d(source)
        about = content["parameters"]
        points = np.array(content["data"]["points"], dtype=float)
    except (OSError, RuntimeError, ValueError, KeyError, IndexError, MemoryError) as e:
        text = " ".join(str(e).split())[:200]
        raise InputError(source, "a C3D file that is damaged" + (f": {text}" if text and "::" not in text else "")) from None
    given = str(_first(about["POINT"], "UNITS", "")).strip()
    unit = given or "mm"
    if unit.lower() not in METRES:
        raise InputError(source, f"a C3D file with POINT:UNITS '{unit[:20]}'; expected m, cm or mm")
    rate = float(_first(about["POINT"], "RATE", 0.0))
    if not _SLOWEST <= rate <= _FASTEST:
        raise InputError(source, f"a C3D file with POINT:RATE {rate:g}; expected {_SLOWEST:g} to {_FASTEST:g} frames per second")
    _check_whole(source, points.shape[2])
    problems = [] if given else ["the file does not say POINT:UNITS; millimetres are assumed"]
    scale = METRES[unit.lower()]
    markers: dict[str, np.ndarray] = {}
    for i, name in enumerate(map(str, about["POINT"].get("LABELS", {}).get("value", [])[:points.shape[1]])):
        p = points[:3, i].T * scale
        p[(p == 0).all(axis=1)] = np.nan  # some writers mark unseen markers like this
        if name in markers:
            problems.append(f"two markers are called '{name}': the first is read")
        markers.setdefault(name, p)
    bodies = _bodies(source, content, scale)
    count = points.shape[2] or max((len(p) for p, _ in bodies.values()), default=0)
    up, time = _up(source, about["POINT"]), np.arange(count) / rate
    return recording_of(source, "c3d", Capture(time, bodies, markers, up, units=unit, problems=tuple(problems)))


def _up(source: str, about: Any) -> Literal["y", "z"]:
    """The axis that points up: that of the screen's vertical. InputError where that is another one, or horizontal, too."""
    x, y = (str(_first(about, name, other)).strip().upper() for name, other in (("X_SCREEN", ""), ("Y_SCREEN", "+Z")))
    if y.lstrip("+") not in ("Y", "Z"):
        raise InputError(source, f"a C3D file with POINT:Y_SCREEN '{y[:20]}'; expected +Z or +Y, the axis that points up")
    if x.lstrip("+-") == y.lstrip("+"):
        raise InputError(source, f"a C3D file with POINT:X_SCREEN '{x[:20]}' and Y_SCREEN '{y[:20]}'; expected two axes")
    return "y" if "Y" in y else "z"


def _check_whole(source: str, frames: int) -> None:
    """InputError where fewer frames were read than the header counts: the package reads up to the end of a file that was cut."""
    with Path(source).open("rb") as file:
        head = file.read(_BLOCK)
        file.seek((head[0] - 1) * _BLOCK + 3)
        processor = file.read(1)
    first, last = struct.unpack_from("<HH", head, 6)
    if processor == bytes([_INTEL]) and last < _MOST_COUNTED and frames < last - first + 1:
        raise InputError(source, f"a C3D file that is cut: it holds {frames} of {last - first + 1} frames")


def _first(group: Any, name: str, other: Any) -> Any:
    values = group.get(name, {}).get("value", [])
    return values[0] if len(values) else other


def _bodies(source: str, content: Any, scale: float) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Rigid bodies by the file's ROTATION group (4 by 4 matrices), as Qualisys and Theia write them."""
    labels = content["parameters"].get("ROTATION", {}).get("LABELS", {}).get("value", [])
    poses = np.array(content["data"].get("rotations", np.empty((4, 4, 0, 0))), dtype=float)
    out = {}
    for i, name in enumerate(labels[:poses.shape[2]]):
        X = poses[:, :, i].transpose(2, 0, 1)
        q = rotations(source, str(name), X[:, :3, :3], 1)
        out[str(name)] = np.where(np.isfinite(q[:, :1]), X[:, :3, 3] * scale, np.nan), q
    return out


FORMAT = RecordingFormat("c3d", "a C3D file", matches, read_c3d)
