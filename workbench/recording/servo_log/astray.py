"""Finds isolated readings that deviate from a joint's path by less than a leap: values that a bus writes when a servo did not
answer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.files.problem import RemovedReadings
from workbench.types import Array, Mask


@dataclass(frozen=True)
class AstrayChecks:
    """rows: longest deviation. times: least deviation from the line between the neighbours, in multiples of that of `share` of
    the readings nearby, with `way` of the joint's travel per row there, and at least `least` [deg]; again: least deviation in
    multiples of the steps of the two neighbouring rows where its value occurs several times. near: rows on each side that count.
    slowest: rows further apart are not used [s]. most: share of a log's rows beyond which they are no exception."""

    rows: int = 2
    times: float = 4.0
    way: float = 1.5
    share: float = 0.9
    least: float = 2.0
    again: float = 1.0
    near: int = 12
    slowest: float = 0.1
    most: float = 0.2


ASTRAY = AstrayChecks()


def without_astray(time: Array, position: Array, c: AstrayChecks = ASTRAY) -> tuple[Array, list[str]]:
    """Positions (N,) [rad] at times (N,) [s] with such readings blanked (NaN), and a line that counts them."""
    seen = np.flatnonzero(np.isfinite(position))
    if len(seen) < 4 * c.near or float(np.median(np.diff(time))) > c.slowest:
        return position, []
    values = position[seen]
    off = _off(values, c)
    returning = [v for v, n in zip(*np.unique(values[off], return_counts=True)) if n > 1]
    if returning:  # a value that means "no answer" does so even when the joint is close to it
        off |= np.isin(values, returning) & _alone(values, c)
    if not off.any() or off.mean() > c.most:
        return position, []
    out = position.copy()
    out[seen[off]] = np.nan
    first = int(np.flatnonzero(off)[0])
    one = len(returning) == 1 and bool(np.isin(values[off], returning).all())
    value = f"all of exactly {np.rad2deg(returning[0]):.4g} deg" if one else \
        f"the first of {np.rad2deg(values[first]):.4g} deg"
    return out, [RemovedReadings(f"{int(off.sum())} single reading(s) lie off the joint's way, {value}, the first at "
                                 f"{time[seen[first]]:.3f} s (row {seen[first] + 1}): as a bus writes when a servo does not "
                                 "answer; taken out")]


def _off(values: Array, c: AstrayChecks) -> Mask:
    """Which of values (N,) go out and come back within `rows`, further than their neighbours go."""
    off = np.zeros(len(values), dtype=bool)
    for width in range(1, c.rows + 1):
        kept = np.flatnonzero(~off)
        for row in _excursions(values[kept], width, c):
            off[kept[row:row + width]] = True
    return off


def _excursions(values: Array, width: int, c: AstrayChecks) -> list[int]:
    """The first of each `width` values that lie off the line between their neighbours."""
    k = np.arange(2, len(values) - width - 1)
    before, after = values[k - 1], values[k + width]
    away = np.stack([values[k + i] - before - (after - before) * (i + 1) / (width + 1) for i in range(width)])
    far = np.where((np.sign(away) == np.sign(away[0])).all(axis=0), np.abs(away).min(axis=0), 0.0)
    beside = (before - values[k - 2] + values[k + width + 1] - after) / 2  # the joint's motion per row there
    goes_on = np.abs(after - before - beside * (width + 1)) < far / 2
    bend = np.zeros(len(values))
    bend[1:-1] = np.abs(values[1:-1] - (values[:-2] + values[2:]) / 2)
    out = []
    for i in np.flatnonzero(goes_on & (far > np.deg2rad(c.least)) & (far > c.way * np.abs(after - before) / (width + 1))):
        row = int(k[i])
        around = np.concatenate([bend[max(row - 2 - c.near, 0):max(row - 2, 0)], bend[row + width + 2:row + width + 2 + c.near]])
        if len(around) and far[i] > c.times * float(np.quantile(around, c.share)):
            out.append(row)
    return out


def _alone(values: Array, c: AstrayChecks) -> Mask:
    """Which of values (N,) lie outside the range of their neighbours by more than `again` times that range."""
    off = np.zeros(len(values), dtype=bool)
    before, here, after = values[:-2], values[1:-1], values[2:]
    outside = np.maximum(here - np.maximum(before, after), np.minimum(before, after) - here)
    off[1:-1] = outside > c.again * np.abs(after - before)
    return off
