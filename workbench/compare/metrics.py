"""Measures of one take, and of the difference between two, on plain arrays. SI and radians; NaN where undefined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.compare.options import COMPARE, SPARC
from workbench.types import Array, Mask


def rms(x: Array, axis: int = 0) -> Array:
    """Root of the mean square along `axis` over the values that are not NaN; NaN where there are none."""
    seen = np.isfinite(x)
    count = seen.sum(axis=axis)
    total = np.sum(np.square(np.where(seen, x, 0.0)), axis=axis)
    return np.asarray(np.sqrt(np.divide(total, count, out=np.full(np.shape(count), np.nan), where=count > 0)))


def rms_difference(a: Array, b: Array, use: Mask) -> Array:
    """RMS of a - b over the frames `use` where both are seen: (n,) for columns (N, n)."""
    return rms(a[use] - b[use])


def rms_distance(a: Array, b: Array, use: Mask) -> float:
    """RMS distance of two paths (N, 3) over the frames `use` where both are seen."""
    return float(rms(np.linalg.norm(a[use] - b[use], axis=1)))


def noise_at_rest(rests: Sequence[Array], least: int = 5) -> Array:
    """RMS about the mean of channels at rest, (n,); NaN below `least` frames. Unbiased in the variance.

    rests: frames at rest (N_k, n) of each take k; each has its own mean, the noise is one for all. Half a second of rest gives
    the noise to 10 %, so it is better to pool the takes of one capture.
    """
    squares, freedom = np.zeros(rests[0].shape[1]), np.zeros(rests[0].shape[1])
    for x in rests:
        seen = np.isfinite(x)
        count = seen.sum(axis=0)
        mean = np.where(seen, x, 0.0).sum(axis=0) / np.maximum(count, 1)
        squares += np.square(np.where(seen, x - mean, 0.0)).sum(axis=0)
        freedom += np.maximum(count - 1, 0)
    known = freedom >= least - 1
    return np.sqrt(np.divide(squares, freedom, out=np.full(len(squares), np.nan), where=known))


def correlation(a: Array, b: Array, use: Mask) -> Array:
    """Pearson's correlation of each column over the frames `use`; NaN for a column that does not move."""
    both = use[:, None] & np.isfinite(a) & np.isfinite(b)
    count = np.maximum(both.sum(axis=0), 1)

    def centre(x: Array) -> Array:
        x = np.where(both, x, 0.0)
        return np.where(both, x - x.sum(axis=0) / count, 0.0)

    x, y = centre(a), centre(b)
    spread = np.sqrt((x * x).sum(axis=0) * (y * y).sum(axis=0))
    return np.asarray(np.divide((x * y).sum(axis=0), spread, out=np.full(len(spread), np.nan), where=spread > 1e-12))


def lag(time: Array, a: Array, b: Array, use: Mask, noise: Array) -> Array:
    """Time by which column a_j lags b_j [s], (n,): the shift of least RMS difference, interpolated between frames by a parabola.
    NaN for a column of b that moves less than 5 times `noise` (n,) (NaN: 1e-3 rad), or whose best shift lies at the edge of
    +-`COMPARE.most_lag`. Both on the same `time` (N,) [s].
    """
    shown = use[:, None] & np.isfinite(b)
    moves = np.where(shown, b, -np.inf).max(axis=0) - np.where(shown, b, np.inf).min(axis=0)
    ready = moves > np.where(noise > 0, 5 * noise, 1e-3)
    step = max(float(np.median(np.diff(time))), 1 / 240)
    shifts = np.arange(-int(COMPARE.most_lag / step) - 1, int(COMPARE.most_lag / step) + 2) * step
    cost = np.full((len(shifts), a.shape[1]), np.nan)
    for j in np.flatnonzero(ready):
        seen = np.isfinite(b[:, j])
        for i, shift in enumerate(shifts):
            shifted = np.interp(time - shift, time[seen], b[seen, j])
            cost[i, j] = rms(a[use, j] - shifted[use]) ** 2
    out = np.full(a.shape[1], np.nan)
    for j in np.flatnonzero(ready & np.isfinite(cost).all(axis=0)):
        i = int(np.argmin(cost[:, j]))
        if 0 < i < len(shifts) - 1:
            before, at, after = cost[i - 1 : i + 2, j]
            curve = before - 2 * at + after
            out[j] = shifts[i] + (0.5 * step * (before - after) / curve if curve > 0 else 0.0)
    return out


def heading(quat_WB: Array) -> Array:
    """Heading of a link about z, positive to the left, continuous (N,) [rad], from quaternions wxyz (N, 4).

    The direction of the link's x axis in the plane: the rotation without tilt and roll.
    """
    out = np.full(len(quat_WB), np.nan)
    seen = np.isfinite(quat_WB).all(axis=1)
    if seen.any():
        from scipy.spatial.transform import Rotation  # slow to import, and not needed to read a log

        x = Rotation.from_quat(quat_WB[seen], scalar_first=True).as_matrix()[:, :, 0]
        out[seen] = np.unwrap(np.arctan2(x[:, 1], x[:, 0]))
    return out


def displacement(p_WB: Array, since_start: Array) -> Array:
    """Displacement (3,) [m] from the rest before the first command to the last frame seen; NaN where neither is."""
    seen = np.isfinite(p_WB).all(axis=1)
    before, after = seen & (since_start < 0), seen & (since_start >= 0)
    if not after.any():
        return np.full(3, np.nan)
    first = p_WB[before].mean(axis=0) if before.any() else p_WB[after][0]
    return np.asarray(p_WB[after][-1] - first)


def heading_change(quat_WB: Array, since_start: Array) -> float:
    """Change of heading [rad] from the rest before the first command to the last frame seen, whole turns counted."""
    return float(displacement(np.column_stack([heading(quat_WB), np.zeros((len(quat_WB), 2))]), since_start)[0])


def speed(time: Array, x: Array) -> Array:
    """Norm of the rate of columns (N, m), gaps bridged: (N,), NaN where nothing was seen.

    The slope of a straight line over `COMPARE.speed_window` (Savitzky and Golay's first derivative).
    """
    from scipy.signal import savgol_filter

    step = float(np.median(np.diff(time)))
    length = min(2 * max(1, round(COMPARE.speed_window / step / 2)) + 1, len(time) - 1 + len(time) % 2)
    if length < 3 or not np.isfinite(x).any(axis=0).all():
        return np.full(len(time), np.nan)
    bridged = np.column_stack([np.interp(time, time[np.isfinite(c)], c[np.isfinite(c)]) for c in x.T])
    return np.asarray(np.linalg.norm(savgol_filter(bridged, length, 1, deriv=1, delta=step, axis=0), axis=1))


def smoothness(time: Array, speed: Array) -> float:
    """Spectral arc length (SPARC) of a speed profile: minus the length of its normalised spectrum; 0 is smoothest.

    S. Balasubramanian, A. Melendez-Calderon, A. Roby-Brami, E. Burdet: On the analysis of movement smoothness. J. NeuroEng.
    Rehabil. 12:112, 2015, with that paper's `SPARC`. Unlike jerk, it is robust to a
    recording's noise. NaN for a profile that is zero or shorter than four samples.
    """
    if len(speed) < 4 or not np.isfinite(speed).all() or not np.any(speed):
        return float("nan")
    rate = 1 / float(np.median(np.diff(time)))
    size = 2 ** (int(np.ceil(np.log2(len(speed)))) + SPARC.padding)
    spectrum = np.abs(np.fft.rfft(speed, size))
    frequency = np.fft.rfftfreq(size, 1 / rate)
    spectrum = spectrum[frequency <= SPARC.cutoff] / spectrum.max()
    frequency = frequency[frequency <= SPARC.cutoff]
    above = np.flatnonzero(spectrum >= SPARC.threshold)
    inside = slice(above[0], above[-1] + 1)
    frequency, spectrum = frequency[inside], spectrum[inside]
    if len(frequency) < 2:
        return float("nan")
    return -float(np.hypot(np.diff(frequency) / (frequency[-1] - frequency[0]), np.diff(spectrum)).sum())
