"""A capture as a Motive CSV file, version 1.23 layout, quaternions, metres."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from studies.other_engine.capture import Capture
from workbench.files.reading import write_whole

_KINDS = ("Rotation",) * 4 + ("Position",) * 3 + ("Mean Marker Error",)
_AXES = (*"XYZW", *"XYZ", "")


def write_motive_csv(
    path: str | Path, capture: Capture, name: str, digits: int = 6, frames_in_take: int | None = None
) -> None:
    """Writes what `motive_csv` says."""
    write_whole(path, motive_csv(capture, name, digits, frames_in_take))


def motive_csv(capture: Capture, name: str, digits: int = 6, frames_in_take: int | None = None) -> str:
    """Text of rigid bodies; blank cells where unseen. `frames_in_take`: of the whole take, where this is its start."""
    assets = list(capture.p)
    total = len(capture) if frames_in_take is None else frames_in_take
    header = {
        "Format Version": "1.23", "Take Name": name, "Take Notes": "", "Capture Frame Rate": f"{capture.rate:.6f}",
        "Export Frame Rate": f"{capture.rate:.6f}", "Capture Start Time": "2020-09-14 02.11.09.214 PM",
        "Total Frames in Take": str(total), "Total Exported Frames": str(total), "Rotation Type": "Quaternion",
        "Length Units": "Meters", "Coordinate Space": "Global",
    }
    width = len(_KINDS)
    lines = [
        ",".join(f"{k},{v}" for k, v in header.items()),
        "",
        ",Type," + ",".join(["Rigid Body"] * (width * len(assets))),
        ",Name," + ",".join(a for a in assets for _ in _KINDS),
        ",ID," + ",".join(f"{i + 1:032X}" for i in range(len(assets)) for _ in _KINDS),
        ",," + ",".join(_KINDS * len(assets)),
        "Frame,Time (Seconds)," + ",".join(_AXES * len(assets)),
    ]
    table = np.hstack([np.column_stack([capture.quat[a], capture.p[a], capture.error[a]]) for a in assets])
    for k, row in enumerate(table):
        cells = ("" if np.isnan(x) else f"{x:.{digits}f}" for x in row)
        lines.append(f"{k},{k / capture.rate:.6f}," + ",".join(cells))
    return "\n".join(lines) + "\n"
