"""Values and derivatives of noisy samples with gaps, by a polynomial fitted around each sample."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.types import Array, Mask

ORDER = 3
_CHUNK = 20_000  # samples at once, so that ten minutes of 14 bodies stay below 100 MB


@dataclass(frozen=True)
class Derivatives:
    """A fitted cubic's value and derivatives at each sample, NaN in gaps and where too few neighbours are seen.

    value, first, second: (N, m) in units of y, y/s, y/s². noise: (m,) in units of y, the standard deviation of
    independent noise on single samples, as the median scatter about the fit shows it.
    """

    value: Array
    first: Array
    second: Array
    noise: Array


def differentiate(time: Array, y: Array, window: float) -> Derivatives:
    """Least-squares cubic over `window` [s] around each of the times (N,) [s], for each column of y (N, m).

    On even samples without gaps this is Savitzky and Golay's filter (Anal. Chem. 36, 1964), as in motion.smoothing; near
    gaps and ends it uses the samples that are there. A sample that is not seen, or with fewer than ORDER + 1 neighbours, is NaN.
    """
    time, y = np.asarray(time, dtype=float), np.asarray(y, dtype=float)
    fits = [np.full_like(y, np.nan) for _ in range(3)]
    seen = np.isfinite(y)
    patterns, group = np.unique(seen.T, axis=0, return_inverse=True)  # columns with the same gaps share their fits
    for k, pattern in enumerate(patterns):
        columns = np.flatnonzero(group == k)
        for rows, neighbours, C in _fits(time, pattern, window):
            Y = np.where(pattern[:, None], y[:, columns], 0.0)[neighbours]  # (r, w, columns)
            for derivative, out in enumerate(fits):
                out[np.ix_(rows, columns)] = np.einsum("rw,rwc->rc", C[:, derivative], Y)
    noise = [_scatter(time, residual, window) for residual in (y - fits[0]).T]
    return Derivatives(fits[0], fits[1], fits[2], np.array(noise))


def _fits(time: Array, seen: Mask, window: float) -> Iterator[tuple[NDArray[np.int_], NDArray[np.int_], Array]]:
    """Yields (rows, indices of their neighbours (r, w), coefficients (r, 3, w) of value and derivatives)."""
    half = window / 2 * (1 + 1e-9)
    first, last = np.searchsorted(time, time - half), np.searchsorted(time, time + half, side="right")
    reach = int(np.max(last - first, initial=0))
    good = np.flatnonzero(seen)
    for start in range(0, len(good), _CHUNK):
        rows = good[start:start + _CHUNK]
        neighbours = first[rows, None] + np.arange(reach)
        inside = neighbours < last[rows, None]
        neighbours = np.minimum(neighbours, len(time) - 1)
        weight = (inside & seen[neighbours]).astype(float)
        enough = weight.sum(axis=1) >= ORDER + 2
        rows, neighbours, weight = rows[enough], neighbours[enough], weight[enough]
        if not len(rows):
            continue
        u = (time[neighbours] - time[rows, None]) / half  # in [-1, 1], so that the normal equations are well scaled
        U = u[:, :, None] ** np.arange(ORDER + 1)
        UW = U * weight[:, :, None]
        C = np.linalg.solve(np.einsum("rwi,rwj->rij", UW, U), UW.transpose(0, 2, 1))[:, :3]
        yield rows, neighbours, C * np.array([1, 1 / half, 2 / half**2])[:, None]


def _scatter(time: Array, residual: Array, window: float) -> float:
    """Standard deviation of single samples from the scatter about the fit, robust against moments that a cubic misses."""
    r = np.abs(residual[np.isfinite(residual)])
    if len(r) < ORDER + 2:
        return float("nan")
    samples = max(window / float(np.median(np.diff(time))), ORDER + 2)
    lost = 2.25 / samples  # share of a sample's own noise that the cubic follows at the window's centre (Savitzky and Golay)
    return float(1.4826 * np.median(r) / np.sqrt(max(1 - lost, 0.1)))
