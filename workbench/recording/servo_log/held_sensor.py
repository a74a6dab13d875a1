"""A sensor that is refreshed more slowly than it is read: its positions are older than their stamps, by a varying amount.

A servo measures its position every few milliseconds and answers with the last value. If that period is close to the log's own,
the age of the readings cycles: at 8 ms, read every 10 ms, it is 0, 2, 4, 6, 0 ms, and a moving joint seems to shake. Period and
phase are estimated from the log alone, as those at which positions lie closest to the line between their neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.recording.servo_log.state import resolution
from workbench.types import Array


@dataclass(frozen=True)
class HeldChecks:
    """When a sensor is taken to be held.

    shortest, longest: period searched, in rows; a shorter one has little effect, with a longer one rows repeat. span: rows
    of fastest motion that are examined first. phases: of a period that are tried. drift: largest drift of the ages over these
    rows between two periods that are tried, in periods. left: largest remaining share of the error of interpolation; in 20
    of 24 logs of a servo whose sensor is held it was 0.22 to 0.67, in logs of other servos 0.78 and more. hopeless: share over
    the first rows beyond which the search ends. alike: errors that differ by less belong to one pattern of ages, which several
    periods share: the longest is taken. cut: limit of a single error [rad], as stick and slip are not linear. fewest: least
    number of usable rows. counts: least motion of the joint in a row, in the 90th percentile.
    """

    shortest: float = 0.5
    longest: float = 2.0
    span: int = 80
    phases: int = 8
    drift: float = 0.15
    left: float = 0.71
    hopeless: float = 0.8
    alike: float = 1.1
    cut: float = 0.03
    fewest: int = 60
    counts: float = 3.0


HELD = HeldChecks()


@dataclass(frozen=True)
class Refresh:
    """period, phase [s]: the sensor is refreshed at phase + k period on the log's clock. left: remaining share of the
    interpolation error with positions at those times."""

    period: float
    phase: float
    left: float

    def ages(self, time: Array) -> Array:
        """Age (N,) [s] of the readings at times (N,) [s]."""
        return np.asarray(np.mod(time - self.phase, self.period))


def refresh_of(time: Array, position: Array, c: HeldChecks = HELD) -> Refresh | None:
    """How a sensor whose positions (N,) [rad] were read at times (N,) [s] is refreshed; None if it is not held, or if the log
    does not show it."""
    known = np.isfinite(position)
    t, q = time[known], position[known]
    if len(t) < c.fewest or np.percentile(np.abs(np.diff(q)), 90) < c.counts * max(resolution(q), 1e-9):
        return None
    row = float(np.median(np.diff(t)))
    first = _fastest(q, c.span)
    t0, q0 = t[first], q[first]
    step = c.drift * row / (len(t0) / c.shortest)  # step of the period: the drift of the ages over these rows
    periods = np.arange(c.shortest * row, c.longest * row, step)
    scores = _errors(t0, q0, periods, c)
    if scores.min() > c.hopeless * _plain(t0, q0, c):
        return None
    found = []
    for k in _lowest(scores, 8):
        period, width = float(periods[k]), 2 * step
        for rows in (2 * c.span, 4 * c.span, len(t)):
            inside = _around(first, rows, len(t))
            fine = c.drift * row / (rows / c.shortest)
            near = period + np.arange(-width, width + fine, fine)
            period, width = float(near[int(np.argmin(_errors(t[inside], q[inside], near, c)))]), 2 * fine
        found.append((*_phase(t, q, period, c), period))
    least = min(error for error, _, _ in found)
    error, phase, period = max((f for f in found if f[0] <= c.alike * least), key=lambda f: f[2])
    left = error / _plain(t, q, c)
    return Refresh(period, phase, left) if left <= c.left else None


def at_their_stamps(time: Array, position: Array, refresh: Refresh) -> Array:
    """Positions (N,) [rad] at the times (N,) [s] at which they were read, interpolated between those at which they were measured;
    the last ones are extrapolated."""
    measured = time - refresh.ages(time)
    known = np.isfinite(position)
    at, first = np.unique(measured[known], return_index=True)
    q = position[known][first]
    out = np.interp(time, at, q)
    if len(at) > 1:
        late = time > at[-1]
        out[late] = q[-1] + (q[-1] - q[-2]) / (at[-1] - at[-2]) * (time[late] - at[-1])
    return np.asarray(np.where(known, out, np.nan))


def _fastest(q: Array, span: int) -> slice:
    """The rows with the most motion."""
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(q)))])
    if len(q) <= span:
        return slice(0, len(q))
    begin = int(np.argmax(way[span - 1:] - way[:len(q) - span + 1]))
    return slice(begin, begin + span)


def _around(rows: slice, count: int, most: int) -> slice:
    begin = max(min((rows.start + rows.stop - count) // 2, most - count), 0)
    return slice(begin, min(begin + count, most))


def _lowest(scores: Array, count: int) -> list[int]:
    """Indices of the lowest scores, no two of them adjacent."""
    local = np.flatnonzero((scores <= np.roll(scores, 1)) & (scores <= np.roll(scores, -1)))
    return [int(k) for k in local[np.argsort(scores[local])][:count]]


def _errors(t: Array, q: Array, periods: Array, c: HeldChecks) -> Array:
    """The interpolation error of each period (K,) at its best phase."""
    out = np.full(len(periods), np.inf)
    chunk = max(1, 400_000 // len(t))
    for begin in range(0, len(periods), chunk):
        part = periods[begin:begin + chunk]
        for share in np.arange(c.phases) / c.phases:
            error = _at(t, q, part, share * part, c)
            out[begin:begin + chunk] = np.minimum(out[begin:begin + chunk], error)
    return out


def _plain(t: Array, q: Array, c: HeldChecks) -> float:
    """The interpolation error with positions at their stamps."""
    return float(np.minimum(np.abs(_interpolation(t[None, :], q)), c.cut).sum())


def _phase(t: Array, q: Array, period: float, c: HeldChecks) -> tuple[float, float]:
    """The error of a period at its best phase, and that phase."""
    phases = np.arange(4 * c.phases) / (4 * c.phases) * period
    errors = _at(t, q, np.full(len(phases), period), phases, c)
    best = int(np.argmin(errors))
    return float(errors[best]), float(phases[best])


def _at(t: Array, q: Array, periods: Array, phases: Array, c: HeldChecks) -> Array:
    measured = t - np.mod(t - phases[:, None], periods[:, None])
    return np.asarray(np.minimum(np.abs(_interpolation(measured, q)), c.cut).sum(axis=1))


def _interpolation(measured: Array, q: Array) -> Array:
    """Distance of positions (N,) measured at times (K, N) from the line between their neighbours (K, N - 2)."""
    whole = measured[:, 2:] - measured[:, :-2]
    share = np.divide(measured[:, 1:-1] - measured[:, :-2], whole, out=np.zeros_like(whole), where=whole > 0)
    return np.asarray(q[1:-1] - (q[:-2] + share * (q[2:] - q[:-2])))
