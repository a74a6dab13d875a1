"""A smooth path through way-points, from where the robot stands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from workbench.files import InputError
from workbench.types import Array

SPACING = 0.005
"""Of the samples along a path [m]."""
FARTHEST = 50.0
"""A way-point beyond this [m] is in another unit."""


class WayPath:
    """From the origin, heading along x, through `points` (x forward, y left) [m] in order; a quintic spline over chord length.

    Its curvature begins at zero, because the first cycles go straight whatever is decided, and changes without a kink at the
    way-points, where that of a cubic spline has its peaks.
    InputError where there is none, or two that follow each other are the same.
    """

    def __init__(self, points: Sequence[tuple[float, float]]) -> None:
        every = np.array([(0.0, 0.0), *points], dtype=float)
        if len(every) < 2:
            raise InputError(None, "expected at least one way-point X,Y in metres")
        chords = np.hypot(*np.diff(every, axis=0).T)
        if not np.isfinite(every).all() or np.abs(every).max() > FARTHEST:
            raise InputError(None, f"way-points: expected numbers within {FARTHEST:g} m")
        if chords.min() < 1e-3:
            raise InputError(None, f"way-point {int(np.argmin(chords)) + 1} is where the one before it is")
        knots = np.concatenate([[0.0], np.cumsum(chords)])
        straight = [(1, np.array([1.0, 0.0])), (2, np.zeros(2))]
        ends: Any = (straight, [(3, np.zeros(2)), (4, np.zeros(2))])  # the stubs do not know the form with derivatives
        spline = make_interp_spline(knots, every, k=5, bc_type=ends)
        fine = np.linspace(0.0, knots[-1], max(int(knots[-1] / SPACING), 20))
        self.points = every[1:]
        self.p = np.asarray(spline(fine))
        self.s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(self.p, axis=0).T))])
        tangent = np.asarray(spline(fine, 1))
        self._heading = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
        self.length = float(self.s[-1])

    def project(self, xy: Array, near: float, window: float = 0.5) -> tuple[float, float]:
        """Distance along the path [m] of its point nearest to `xy` (2,), and how far `xy` lies to its left [m]. near: about
        where that is [m]; only `window` [m] around it is searched, so that a path may cross itself. Beyond the end the path goes
        on straight."""
        inside = np.flatnonzero(np.abs(self.s - min(near, self.length)) <= window)
        k = inside[np.argmin(np.hypot(*(self.p[inside] - xy).T))]
        along, left = self._frame(k, xy)
        return float(self.s[k] + along), left

    def heading(self, s: float) -> float:
        """Direction of the tangent at `s` [m along the path], continuous [rad]."""
        return float(np.interp(s, self.s, self._heading))

    def point(self, s: float, left: float = 0.0) -> Array:
        """The point (2,) [m] so far along the path and to its left; beyond the end straight on."""
        angle, beyond = self.heading(s), max(s - self.length, 0.0)
        on = np.array([np.interp(s, self.s, c) for c in self.p.T])
        ahead, aside = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        return np.asarray(on + beyond * ahead + left * aside)

    def _frame(self, k: int, xy: Array) -> tuple[float, float]:
        c, n, d = np.cos(self._heading[k]), np.sin(self._heading[k]), xy - self.p[k]
        return float(c * d[0] + n * d[1]), float(-n * d[0] + c * d[1])
