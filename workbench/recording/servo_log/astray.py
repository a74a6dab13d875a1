"""Single readings that lie off a joint's way by less than a leap: what a bus writes when a servo did not answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AstrayChecks:
    """rows: a reading may be off for so many rows. times: out and back by more than so many of the joint's steps nearby, and at
    least `least` [deg]; again: by so many of the steps of the two rows beside it where its value comes several times. near: rows on each side whose steps count.
    slowest: rows further apart tell nothing [s]. most: share of a log's rows beyond which they are no exception."""

    rows: int = 2
    times: float = 4.0
    least: float = 2.0
    again: float = 1.0
    near: int = 6
    slowest: float = 0.1
    most: float = 0.2


ASTRAY = AstrayChecks()


def without_astray(time: Array, position: Array, c: AstrayChecks = ASTRAY) -> tuple[Array, list[str]]:
    """Positions (N,) [rad] at times (N,) [s] with such readings blanked (NaN), and a line that counts them."""
    seen = np.flatnonzero(np.isfinite(position))
    if len(seen) < 4 * c.near or float(np.median(np.diff(time))) > c.slowest:
        return position, []
    values = position[seen]
    least = np.deg2rad(c.least)
    off = _off(values, c.times, least, c)
    returning = [v for v, n in zip(*np.unique(values[off], return_counts=True)) if n > 1]
    if returning:  # a value that stands for "no answer" is one also where the joint is not far from it
        off |= np.isin(values, returning) & _alone(values, c)
    if not off.any() or off.mean() > c.most:
        return position, []
    out = position.copy()
    out[seen[off]] = np.nan
    first = int(np.flatnonzero(off)[0])
    value = f"all of exactly {np.rad2deg(returning[0]):.4g} deg" if len(returning) == 1 and np.isin(values[off], returning).all() \
        else f"the first of {np.rad2deg(values[first]):.4g} deg"
    return out, [f"{int(off.sum())} single reading(s) lie off the joint's way, {value}, the first at {time[seen[first]]:.3f} s "
                 f"(row {seen[first] + 1}): as a bus writes when a servo does not answer; taken out"]


def _off(values: Array, times: float, least: float, c: AstrayChecks) -> NDArray[np.bool_]:
    """Which of values (N,) go out and come back within `rows`, further than their neighbours go."""
    off = np.zeros(len(values), dtype=bool)
    steps = np.abs(np.diff(values))
    for width in range(1, c.rows + 1):
        k = np.arange(1, len(values) - width)
        before, after = values[k - 1], values[k + width]
        away = np.stack([values[k + i] - before - (after - before) * (i + 1) / (width + 1) for i in range(width)])
        far = np.where((np.sign(away) == np.sign(away[0])).all(axis=0), np.abs(away).min(axis=0), 0.0)
        for i in np.flatnonzero((far > least) & (far > times * np.abs(after - before) / (width + 1))):
            row = int(k[i])
            around = np.concatenate([steps[max(row - 1 - c.near, 0):row - 1], steps[row + width:row + width + c.near]])
            if far[i] > times * float(np.max(around, initial=0.0)):
                off[row:row + width] = True
    return off


def _alone(values: Array, c: AstrayChecks) -> NDArray[np.bool_]:
    """Which of values (N,) lie outside what their neighbours are between, by more than `again` of the way between those."""
    off = np.zeros(len(values), dtype=bool)
    before, here, after = values[:-2], values[1:-1], values[2:]
    outside = np.maximum(here - np.maximum(before, after), np.minimum(before, after) - here)
    off[1:-1] = outside > c.again * np.abs(after - before)
    return off
