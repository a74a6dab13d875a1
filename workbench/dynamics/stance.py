"""Which feet are down, and where the floor is."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from workbench.dynamics.machine import FootPoints
from workbench.files import InputError
from workbench.types import Array, Mask

TOUCH = 3e-3
"""Points up to this far above the floor may carry load [m]."""
LIFTING = 0.3
"""Points that rise or fall faster than this carry none [m/s]; they cross TOUCH within 10 ms."""
SHARP = 5e-4
"""Height above the floor [m] at which force is twice as dear as on it: of a tilted foot the lower edge carries."""
REACH = 0.01
"""A foot's own floor may lie this far above the lowest foot's [m]: leg lengths and rest angles are not known better."""


def floor_under(places: Array, points: FootPoints) -> Array:
    """Height of the floor (F,) [m] as each foot finds it: what its lowest point is below in a tenth of the samples, or, for a
    foot that hardly touches, REACH above the lowest floor of the others. places: (N, C, 3) [m], NaN where unseen."""
    floors = np.full(len(points.feet), np.nan)
    for f in range(len(points.feet)):
        lowest = places[:, points.foot == f, 2].min(axis=1)
        if np.isfinite(lowest).any():
            floors[f] = np.nanquantile(lowest, 0.1)
    with np.errstate(invalid="ignore"):
        return np.minimum(floors, np.min(floors, where=np.isfinite(floors), initial=np.inf) + REACH)


def dearness(places: Array, velocities: Array, points: FootPoints, floor: Array,
             stance: Mapping[str, Mask] | None) -> Array:
    """Cost of force at each point (N, C): 1 on the floor, rising with the height above it, infinite without contact.

    places, velocities: (N, C, 3) [m, m/s] in W. Without `stance` a point is in contact if it is within TOUCH of its foot's
    floor (F,) [m] and slower than LIFTING. With `stance`, foot -> (N,) bool, a foot is down where that is true, and its floor is
    where its lowest point is.
    """
    height = places[:, :, 2] - floor[points.foot]
    if stance is None:
        touching = (height < TOUCH) & (np.abs(velocities[:, :, 2]) < LIFTING)
    else:
        touching = np.zeros(height.shape, dtype=bool)
        for foot, down in stance.items():
            if foot not in points.feet:
                raise InputError(None, f"stance: the robot has no foot '{foot}'; its feet: {' '.join(points.feet) or 'none'}")
            if np.shape(down) != (len(places),):
                raise InputError(None, f"stance, {foot}: expected shape {(len(places),)}, a value a sample, got {np.shape(down)}")
            own = points.foot == points.feet.index(foot)
            height[:, own] -= height[:, own].min(axis=1, keepdims=True)
            touching[:, own] = np.asarray(down, dtype=bool)[:, None] & (height[:, own] < TOUCH)
    return np.where(touching, 1 + (np.maximum(height, 0) / SHARP) ** 2, np.inf)
