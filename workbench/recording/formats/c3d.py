"""C3D files of motion capture, read with the package ezc3d: rigid bodies if the file has them, else bodies formed of markers with
a common name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.files.reading import regular_file
from workbench.recording.formats.capture_table import METRES, Capture, recording_of, rotations
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording

_MARK = 0x50
"""The second byte of every C3D."""


def matches(head: bytes) -> bool:
    """Recognised by its second byte, and by zeros that no text has."""
    return len(head) >= 512 and head[1] == _MARK and 1 <= head[0] <= 20 and b"\0" in head[:64]


def read_c3d(path: Path) -> Recording:
    """Reads markers [m], and rotations of rigid bodies where the file has any; z is up unless POINT:Y_SCREEN says y. InputError
    where the file is damaged or its unit unknown."""
    import ezc3d

    source = str(path)
    regular_file(path)
    try:
        content = ezc3d.c3d(source)
        about = content["parameters"]
        points = np.array(content["data"]["points"], dtype=float)
    except (OSError, RuntimeError, ValueError, KeyError, IndexError, MemoryError) as e:
        raise InputError(source, f"a C3D file that is damaged: {' '.join(str(e).split())[:200]}") from None
    unit = str(_first(about["POINT"], "UNITS", "mm")).strip() or "mm"
    if unit.lower() not in METRES:
        raise InputError(source, f"a C3D file with POINT:UNITS '{unit[:20]}'; expected m, cm or mm")
    rate = float(_first(about["POINT"], "RATE", 0.0))
    if not rate > 0:
        raise InputError(source, f"a C3D file with POINT:RATE {rate:g}; expected a positive number of frames per second")
    scale = METRES[unit.lower()]
    markers = {}
    for i, name in enumerate(about["POINT"].get("LABELS", {}).get("value", [])[:points.shape[1]]):
        p = points[:3, i].T * scale
        p[(p == 0).all(axis=1)] = np.nan  # some writers mark unseen markers like this
        markers[str(name)] = p
    bodies = _bodies(source, content, scale)
    count = points.shape[2] or max((len(p) for p, _ in bodies.values()), default=0)
    up = "y" if "Y" in str(_first(about["POINT"], "Y_SCREEN", "+Z")).upper() else "z"
    return recording_of(source, "c3d", Capture(np.arange(count) / rate, bodies, markers, up=up, units=unit))


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
