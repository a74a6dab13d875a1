"""Response of each joint while it moves: delay, lag, friction and gravity, by regression on training programmes.

A proportional servo has  gain · stall · e = I a + B v + (F0 + F1 |g|) sign v − g  with e the goal less the position, g gravity's
torque, B all damping, I the inertia. Divided by the stiffness K = gain · stall:
  e = a I/K + T v + (f0 + f1 |g|) sign v − c g + e0.
The goal is taken `delay` earlier, and half a period for being held. Delay, lag T and I/K differ only while the joint speeds up
or slows down, and with all three free these recordings do not separate them; so I/K is the published servo's, and the delay is
the remainder. Intervals are of 90 %, by bootstrap over programmes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.so101.robot import ARMATURE, DUTY_PER_RADIAN, KT, RESISTANCE, VOLTAGE
from studies.so101.rows import LOADED, Rows
from workbench.recording.formats.sage import JOINTS
from workbench.types import Array

DELAYS = np.arange(-0.040, 0.0601, 0.002)
DRAWS = 400
INERTIA = ARMATURE / (DUTY_PER_RADIAN * KT * VOLTAGE / RESISTANCE)
"""I/K of the published servo alone [s^2]."""


@dataclass(frozen=True)
class Value:
    """A number and its 90 % interval."""

    value: float
    low: float
    high: float

    def text(self, digits: int = 1, scale: float = 1.0) -> str:
        """For a table."""
        v, low, high = (f"{scale * x:.{digits}f}".replace("-", "−") for x in (self.value, self.low, self.high))
        return f"{v} ({low} to {high})"

    def scaled(self, by: float) -> Value:
        """In other units."""
        return Value(self.value * by, *sorted((self.low * by, self.high * by)))


@dataclass(frozen=True)
class Response:
    """One joint. delay, lag T and both together, `late` [s]; friction f0, offset e0 [rad]; only where gravity turns the joint:
    compliance c [rad/(N m)] and load_friction f1/c, friction over load. left: RMS that remains, spread: RMS of the error
    [rad]; over so many rows."""

    joint: str
    delay: Value
    lag: Value
    late: Value
    friction: Value
    offset: Value
    compliance: Value | None
    load_friction: Value | None
    left: float
    spread: float
    rows: int


def response(joint: str, training: Sequence[Rows], seed: int = 0) -> Response:
    """The regression of one joint over training programmes."""
    i, loaded = JOINTS.index(joint), joint in LOADED
    moments = np.array([[_moments(r, i, loaded, d) for d in DELAYS] for r in training])
    best, x, left, spread, n = _solve(moments.sum(axis=0))
    rng = np.random.default_rng(seed)
    drawn = []
    for _ in range(DRAWS):
        k, y, *_ = _solve(moments[rng.integers(0, len(moments), len(moments))].sum(axis=0))
        drawn.append(_numbers(k, y, loaded))
    low, high = np.quantile(drawn, [0.05, 0.95], axis=0)
    delay, lag, late, friction, offset, *more = (Value(*map(float, v)) for v in zip(_numbers(best, x, loaded), low, high))
    compliance, load = (more[0], more[1]) if more else (None, None)
    return Response(joint, delay, lag, late, friction, offset, compliance, load, left, spread, n)


def _numbers(delay: int, x: Array, loaded: bool) -> list[float]:
    delayed = float(DELAYS[delay])
    out = [delayed, float(x[0]), delayed + float(x[0]), float(x[1]), float(x[2])]
    return [*out, float(x[3]), float(x[4] / x[3])] if loaded else out


def _moments(r: Rows, i: int, loaded: bool, delay: float) -> Array:
    """Sums of products of regressors and error (k + 1, k + 1) over the rows in which the joint moves."""
    use = r.moving[:, i]
    v, g = r.v[use, i], r.gravity[use, i]
    sign = np.sign(v)
    error = r.error(i, delay + r.of.period / 2)[use] - INERTIA * r.a[use, i]
    columns = [v, sign, np.ones_like(v), *([-g, np.abs(g) * sign] if loaded else []), error]
    a = np.column_stack(columns)
    return np.asarray(a.T @ a)


def _solve(moments: Array) -> tuple[int, Array, float, float, int]:
    """Delay (index) and coefficients with the least error; RMS left, RMS about the mean [rad], rows."""
    fits = []
    for m in moments:
        x = np.linalg.lstsq(m[:-1, :-1], m[:-1, -1], rcond=1e-10)[0]
        fits.append((float(m[-1, -1] - x @ m[:-1, -1]), x))
    best = min(range(len(fits)), key=lambda k: fits[k][0])
    m = moments[best]
    n = m[2, 2]
    return best, fits[best][1], float(np.sqrt(max(fits[best][0], 0.0) / n)), float(np.sqrt(m[-1, -1] / n)), round(float(n))
