"""A gait cycle by cycle: the motion in each, and how much they differ."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from workbench.recording.take import Take
from workbench.types import Array


@dataclass(frozen=True)
class Scatter:
    """How a settled gait varies from one cycle to the next, as standard deviations: speed along the way it goes [m/s], and
    heading [rad]."""

    speed: float
    heading: float


def cycles_of(take: Take, begin: float, period: float, end: float = math.inf) -> Array:
    """Forward and sideways velocity [m/s], in the base's heading, and turn [rad] of each whole cycle from `begin` to `end` [s]
    or the take's end: (N, 3)."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    w, x, y, z = take.quat_WB.T
    heading = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    count = int((min(float(take.time[-1]), end) - begin) / period + 1e-6)
    edges = begin + period * np.arange(count + 1)
    p = np.stack([np.interp(edges, take.time, take.p_WB[:, i]) for i in range(2)], axis=1)
    h = np.interp(edges, take.time, heading)
    step, middle = np.diff(p, axis=0) / period, (h[1:] + h[:-1]) / 2
    forward = step[:, 0] * np.cos(middle) + step[:, 1] * np.sin(middle)
    left = step[:, 1] * np.cos(middle) - step[:, 0] * np.sin(middle)
    return np.column_stack([forward, left, np.diff(h)])


def scatter_of(cycles: Array) -> Scatter:
    """The scatter of cycles (N, 3) as `cycles_of` gives them; NaN of fewer than two."""
    if len(cycles) < 2:
        return Scatter(math.nan, math.nan)
    way = cycles[:, :2].mean(axis=0)
    along = cycles[:, :2] @ (way / max(float(np.hypot(*way)), 1e-9))
    return Scatter(float(along.std()), float(cycles[:, 2].std()))
