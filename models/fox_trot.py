"""Writes data/fox/trot.csv, a plain trot for the fox: `python -m models.fox_trot [FILE]`.

Diagonal legs alternate; a foot that stands goes straight back, one that swings goes forward in half a sine. Not optimised, and
nobody's gait: it is there to be played, compared and diagnosed.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

from models.build_fox import LEGS, ROOT, SHANK, THIGH
from workbench.files.reading import write_whole

POSES = 8
DWELL = 0.08
"""Between poses [s]."""
HEIGHT, STRIDE, LIFT = 0.135, 0.036, 0.018
"""Of the hips over the feet's centres, of a standing foot's way, of a swinging foot over it [m]."""
FORWARD = 0.004
"""Feet stand this far ahead of the hips [m], under the centre of mass."""


def leg_angles(x: float, z: float) -> tuple[float, float]:
    """HFE and KFE [rad] that put the foot x ahead of and z above (negative: below) the hip [m], the knee ahead of it."""
    reach = math.hypot(x, z)
    knee = math.acos((reach**2 - THIGH**2 - SHANK**2) / (2 * THIGH * SHANK))
    return math.atan2(-x, -z) - math.atan2(SHANK * math.sin(knee), THIGH + SHANK * math.cos(knee)), knee


def table() -> str:
    """The pose table; its last pose is its first row, where the cycle closes."""
    rows = ["time," + ",".join(f"{leg}_{joint}" for leg, *_ in LEGS for joint in ("HAA", "HFE", "KFE"))]
    for k in range(POSES + 1):
        cells = [f"{k * DWELL:.2f}"]
        for _, x, y in LEGS:
            phase = (k / POSES + (0.0 if x * y > 0 else 0.5)) % 1.0
            swing = phase - 0.5
            along = 0.5 - 2 * phase if swing < 0 else 2 * swing - 0.5
            up = LIFT * math.sin(2 * math.pi * swing) if swing > 0 else 0.0
            cells += ["0.00", *(f"{math.degrees(a):.2f}" for a in leg_angles(FORWARD + STRIDE * along, up - HEIGHT))]
        rows.append(",".join(cells))
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    print(write_whole(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "data/fox/trot.csv", table()))
