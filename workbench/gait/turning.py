"""A robot's own turning, estimated from one recording or several, and the turn in each stance that cancels it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench.files import InputError
from workbench.types import Array

MOST_TRIM = 0.15
"""Largest change of `turn` [rad in a stance] by which a gait is straightened: beyond it feet leave their reach."""
GAIN_SPREAD = 0.3
"""Standard deviation, as a share, of a robot's response to `turn` about the nominal robot's."""
LEAST_SD = math.radians(0.5)
"""Of a recorded heading [rad/m]: cameras, floor and calibration are no better."""
FEWEST_CYCLES = 3
"""Whole cycles of walking from which a heading and its scatter can be told."""
WALKS = 0.85
"""Share of the usual distance of a cycle from which a robot walks: less is its start, its stop, or rest."""
IN_A_CYCLE = 24
"""Times at which each cycle is looked at for whether the robot walks."""


@dataclass(frozen=True)
class RecordedTurn:
    """Change of heading by distance of a recorded walk. heading: to the left, and sd: its standard deviation by the scatter from
    cycle to cycle [rad/m]. metres: walked; cycles: how many."""

    heading: float
    sd: float
    metres: float
    cycles: int
    speed: float


def recorded_turn(time: Array, p: Array, heading: Array, period: float, source: str = "recording") -> RecordedTurn:
    """The turn that a robot's path shows: time (N,) [s], p (N, 2) [m] along the floor, heading (N,) [rad]. period: of the gait's
    cycle [s].

    Only whole cycles between start and stop count, so that neither has to be known. InputError where there are fewer than three.
    """
    seen = np.isfinite(p).all(axis=1) & np.isfinite(heading)
    needed = f"expected {FEWEST_CYCLES} or more whole cycles of {period:.3g} s of walking"
    if seen.sum() < 2 or time[seen][-1] - time[seen][0] < FEWEST_CYCLES * period:
        raise InputError(source, f"{needed}; the base was not seen for so long")
    time, p, heading = time[seen], p[seen], np.unwrap(heading[seen])
    grid = np.arange(time[0], time[-1] - period, period / IN_A_CYCLE)
    at = np.stack([np.interp(grid, time, p[:, i]) for i in (0, 1)], axis=1)
    later = np.stack([np.interp(grid + period, time, p[:, i]) for i in (0, 1)], axis=1)
    gone = np.linalg.norm(later - at, axis=1)
    walking = gone > WALKS * np.quantile(gone, 0.9)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], walking.astype(int), [0]])))
    begin, end = max(zip(edges[::2], edges[1::2]), key=lambda e: e[1] - e[0])
    count = int((end - 1 - begin) / IN_A_CYCLE) + 1
    if count < FEWEST_CYCLES:
        raise InputError(source, f"{needed}, found {count}")
    ends = grid[begin] + period * np.arange(count + 1)
    h = np.interp(ends, time, heading)
    path = np.stack([np.interp(ends, time, p[:, i]) for i in (0, 1)], axis=1)
    metres = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())
    scatter = float(np.std(np.diff(h), ddof=1)) * math.sqrt(count)
    return RecordedTurn(float(h[-1] - h[0]) / metres, max(scatter / metres, LEAST_SD), metres, count, metres / (count * period))


@dataclass(frozen=True)
class TurnEstimate:
    """Model of one robot: heading by distance [rad/m] is bias plus gain times the change of `turn` [rad].

    mean: (bias, gain), covariance (2, 2). Both begin at the ensemble's and the nominal robot's."""

    mean: Array
    covariance: Array

    @staticmethod
    def before(spread: float, gain: float, share: float = GAIN_SPREAD) -> TurnEstimate:
        """Before any recording. spread: of headings over the ensemble's robots [rad/m]; gain: expected [1/m]; share: its standard
        deviation, by the gain."""
        return TurnEstimate(np.array([0.0, gain]), np.diag([max(spread, LEAST_SD) ** 2, (share * gain) ** 2]))

    def after(self, turn: float, heading: float, sd: float) -> TurnEstimate:
        """After a recording. turn: change from the untrimmed gait's [rad]; heading, sd [rad/m]."""
        row = np.array([1.0, turn])
        gain = self.covariance @ row / (row @ self.covariance @ row + sd**2)
        mean = self.mean + gain * (heading - row @ self.mean)
        return TurnEstimate(mean, self.covariance - np.outer(gain, row @ self.covariance))

    @property
    def turn(self) -> float:
        """The change of `turn` [rad] that straightens the robot, within MOST_TRIM."""
        bias, gain = self.mean
        return float(np.clip(-bias / gain, -MOST_TRIM, MOST_TRIM))

    @property
    def bias(self) -> tuple[float, float]:
        """The robot's own turning and its standard deviation [rad/m]."""
        return float(self.mean[0]), float(np.sqrt(self.covariance[0, 0]))


def rms(headings: Sequence[float]) -> float:
    """Root mean square; NaN of none."""
    return float(np.sqrt(np.mean(np.square(headings)))) if len(headings) else math.nan
