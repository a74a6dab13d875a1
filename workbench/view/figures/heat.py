"""How far a recording deviates from a model, as a colour: one scale for the map over time, the robot's picture and the replay."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, LogNorm, to_hex

from workbench.types import Array
from workbench.view.figures.errors import LIMIT
from workbench.view.figures.style import RECORDED

BIN = 0.1
"""Width of a cell [s]."""
DARKEST = 30.0
"""Error over noise at which the scale is darkest."""
HEAT = LinearSegmentedColormap.from_list("gap", ["#F4F7F5", "#FCE3C5", "#F2A65A", RECORDED, "#7A2E00"]
                                         ).with_extremes(bad="#D9D9DD")
"""Grey where nothing was seen."""
SCALE = LogNorm(LIMIT, DARKEST, clip=True)


def cells(time: Array, residual: Array, edges: Array) -> Array:
    """RMS of each channel (N, c) in each bin: (c, bins), masked where nothing was seen."""
    at = np.digitize(time, edges) - 1
    inside = (at >= 0) & (at < len(edges) - 1)
    out = np.full((residual.shape[1], len(edges) - 1), np.nan)
    for c, column in enumerate(residual.T):
        use = inside & np.isfinite(column)
        count = np.bincount(at[use], minlength=out.shape[1])
        total = np.bincount(at[use], np.square(column[use]), minlength=out.shape[1])
        np.divide(total, count, out=out[c], where=count > 0)
    return np.ma.masked_invalid(np.sqrt(out))  # type: ignore[no-any-return, no-untyped-call]


def shares(ratio: Array) -> Array:
    """Where on the scale an error over noise lies: 0 up to LIMIT, 1 from DARKEST on; 0 where it is unknown."""
    return np.asarray(SCALE(np.nan_to_num(ratio, nan=LIMIT)).filled(0.0), dtype=float)


def colours(ratio: Array) -> Array:
    """sRGB (..., 3) of errors over noise; grey where unknown."""
    return np.asarray(HEAT(np.ma.masked_invalid(SCALE(np.ma.masked_invalid(ratio))))[..., :3])  # type: ignore[no-untyped-call]


def gradient() -> str:
    """The scale as CSS, palest first."""
    return f"linear-gradient(90deg,{','.join(to_hex(HEAT(x)) for x in np.linspace(0, 1, 5))})"
