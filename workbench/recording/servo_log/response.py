"""Fits how a servo responds to its goals (delay, smoothing, gain and offset), robustly, as a part of the log may be wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.types import Array, Mask


@dataclass(frozen=True)
class ResponseChecks:
    """lags and smoothings: pure delays and time constants that are tried [s]. finest: step of the grid on which goals are
    smoothed [s]. most: rows that are fitted, evenly chosen. rounds: of reweighting. outlier: residuals beyond so many robust
    standard deviations count less. good: share of the rows, the best fitted ones, by which candidates are compared. fewest:
    rows that tell."""

    lags: tuple[float, ...] = (0.0, 0.02, 0.04, 0.06, 0.09, 0.13, 0.18, 0.26)
    smoothings: tuple[float, ...] = (0.0, 0.025, 0.05, 0.09, 0.15)
    finest: float = 0.01
    most: int = 600
    rounds: int = 4
    outlier: float = 2.0
    good: float = 0.7
    fewest: int = 30


RESPONSE = ResponseChecks()


@dataclass(frozen=True)
class Response:
    """position = gain * (goal, delayed and smoothed) + offset. predicted: that, at every row (N,) [rad]. offset and spread [rad];
    spread: the robust standard deviation of the residual. explained: share of the position's variance among the rows that are
    no outliers, at most 1; 0 where the goals do not predict the position."""

    predicted: Array
    gain: float
    offset: float
    spread: float
    explained: float


def shapes(time: Array, goal: Array, c: ResponseChecks = RESPONSE) -> Array:
    """Goals (N,) [rad], held from row to row at times (N,) [s], with each delay and smoothing: (M, N) [rad]."""
    step = min(c.finest, float(np.median(np.diff(time))))
    step = max(step, float(time[-1] - time[0]) / 200_000)
    grid = np.arange(time[0], time[-1] + step, step)
    held = goal[np.clip(np.searchsorted(time, grid + 1e-9, side="right") - 1, 0, len(goal) - 1)]
    out = []
    for constant in c.smoothings:
        smooth = held
        if constant > step / 2:
            weights = np.exp(-np.arange(0, 5 * constant, step) / constant)
            padded = np.concatenate([np.full(len(weights) - 1, held[0]), held])
            smooth = np.convolve(padded, weights / weights.sum(), "valid")
        out += [np.interp(time - lag, grid, smooth) for lag in c.lags]
    return np.array(out)


def fit_response(shaped: Array, position: Array, rows_used: Mask | None = None, c: ResponseChecks = RESPONSE) -> Response:
    """The best of the `shapes` (M, N) [rad] for positions (N,) [rad], fitted on the rows `told` (N,), all if left out."""
    rows = np.flatnonzero(rows_used) if rows_used is not None else np.arange(len(position))
    nothing = Response(np.full(len(position), float(np.mean(position[rows])) if len(rows) else 0.0), 0.0, 0.0,
                       float(np.std(position[rows])) if len(rows) else 0.0, 0.0)
    if len(rows) < c.fewest or np.ptp(position[rows]) == 0:
        return nothing
    rows = rows[::max(1, len(rows) // c.most)]
    x, y = shaped[:, rows], position[rows]
    kept = np.ptp(x, axis=1) > 0
    if not kept.any():
        return nothing
    weights = np.ones_like(x)
    for _ in range(c.rounds):
        total = weights.sum(axis=1)
        mx, my = (weights * x).sum(axis=1) / total, (weights * y).sum(axis=1) / total
        dx = x - mx[:, None]
        size = (weights * dx * dx).sum(axis=1)
        gain = (weights * dx * (y - my[:, None])).sum(axis=1) / np.where(size > 0, size, np.inf)
        offset = my - gain * mx
        left = np.abs(y - gain[:, None] * x - offset[:, None])
        scale = 1.4826 * np.median(left, axis=1) + 1e-9
        weights = 1 / np.maximum(1.0, left / (c.outlier * scale[:, None])) ** 2
    best_part = np.sort(left, axis=1)[:, :max(int(c.good * len(rows)), 1)].mean(axis=1)
    best = int(np.argmin(np.where(kept, best_part, np.inf)))
    predicted = gain[best] * shaped[best] + offset[best]
    inside = left[best] < 4 * scale[best]
    spread_of = float(np.var(y[inside]))
    explained = 1 - float(np.mean(left[best][inside] ** 2)) / spread_of if spread_of > 0 else 0.0
    return Response(predicted, float(gain[best]), float(offset[best]), float(scale[best]), max(explained, 0.0))
