"""A plain stand-in for a model: each joint follows its goal after a delay, times a gain, plus a constant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.so101.programmes import Programme
from workbench.types import Array

DELAYS = np.arange(0.0, 0.2501, 0.005)


@dataclass(frozen=True)
class Baseline:
    """position = gain · goal(t − delay) + offset, each (6,) [1, s, rad]."""

    gain: Array
    delay: Array
    offset: Array

    def position(self, p: Programme) -> Array:
        """Prediction for a programme (N, 6)."""
        return np.column_stack([self.gain[i] * _late(p, i, self.delay[i]) + self.offset[i] for i in range(p.sent.shape[1])])


def fit_baseline(training: Sequence[Programme]) -> Baseline:
    """Least squares over training programmes, joint by joint."""
    found = []
    for i in range(training[0].sent.shape[1]):
        read = np.concatenate([p.read[:, i] for p in training])
        fits = []
        for delay in DELAYS:
            goal = np.concatenate([_late(p, i, delay) for p in training])
            a = np.column_stack([goal, np.ones_like(goal)])
            x = np.linalg.lstsq(a, read, rcond=None)[0]
            fits.append((float(np.sum((read - a @ x) ** 2)), delay, x))
        _, delay, x = min(fits, key=lambda f: f[0])
        found.append((x[0], delay, x[1]))
    return Baseline(*np.array(found).T)


def _late(p: Programme, i: int, delay: float) -> Array:
    return np.asarray(np.interp(p.time - delay, p.time, p.sent[:, i]))
