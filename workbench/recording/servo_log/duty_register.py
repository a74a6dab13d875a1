"""Recognises a column that is a servo's duty register, and reads the servo's law from it, without dynamics.

A Feetech's register of load holds the duty of its H-bridge: 0 to 1000, bit 10 (1024) the sign. It shows the servo's law directly:
duty as a function of the distance between a goal, delayed and ramped, and the position."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.types import Array, Mask

SIGN, FULL = 1024, 1000
SCALES = (1, 10, 100, 1000)
"""Units in which a column may hold the register: loggers divide by them."""


@dataclass(frozen=True)
class RegisterChecks:
    """When a column is taken for the duty register, and when its law is identified.

    whole: largest distance of its values from whole numbers. follows: least correlation of duty, below full, with goal less
    position. fewest: least number of rows with torque on. start: seconds left out at the log's beginning, in which the register
    holds an earlier value. delays [s], ramps [rad/s], duty: initial values of the fit. error: residual [rad of goal] above which
    it counts less. soft: width of the sign [rad], half a count. sure: share of the ramp below which its standard error has to be,
    else no goal was fast enough to identify it. missed: median residual [rad of goal] beyond which the law is another,
    unless it is less than `share` of the error behind the duty: register and position are read at different times, which costs a
    fast motion more.
    """

    whole: float = 0.02
    follows: float = 0.6
    fewest: int = 100
    start: float = 0.1
    delays: tuple[float, ...] = (0.0, 0.012, 0.024, 0.04)
    ramps: tuple[float, ...] = (5.0, 20.0)
    duty: float = 0.01
    error: float = 2e-3
    soft: float = 8e-4
    sure: float = 0.15
    missed: float = 5e-3
    share: float = 0.1


REGISTER = RegisterChecks()


@dataclass(frozen=True)
class RegisterLaw:
    """gain: over the nominal one of each log; delay [s], of goals whose stamps run `rate` times as fast as those of positions;
    ramp [rad/s], infinite where no goal was fast enough to identify it; minimum_duty; dead_zone [rad]; missed: median residual
    [rad of goal]; sd: standard errors by name."""

    gain: float
    delay: float
    ramp: float
    minimum_duty: float
    dead_zone: float
    rate: float
    missed: float
    sd: dict[str, float]

    def __str__(self) -> str:
        ramp = "" if np.isinf(self.ramp) else f", ramp {np.rad2deg(self.ramp):.0f} deg/s"
        return (f"{self.gain:.3f} of the nominal gain, goals {1e3 * self.delay:.1f} ms late{ramp}, minimum duty "
                f"{100 * self.minimum_duty:.1f} % outside {np.rad2deg(self.dead_zone):.2f} deg")


def duty_of(column: Array, error: Array, on: Mask, c: RegisterChecks = REGISTER) -> Array | None:
    """Duty (N,), -1 to 1 with the position's sign, of a column that holds the register; None if it is something else. error: goal
    less position (N,) [rad]; on: rows with torque."""
    known = np.isfinite(column)
    if known.sum() < c.fewest or not (column[known] != 0).any():
        return None
    for scale in SCALES:
        counts = column * scale
        whole = np.round(counts)
        if np.abs(counts - whole)[known].max() <= c.whole:
            break
    else:
        return None
    size = np.where(whole >= SIGN, whole - SIGN, whole)
    signs = (whole >= SIGN)[known & (size > 0)]
    if whole[known].min() < 0 or size[known].max() > FULL or not signs.any() or signs.all():
        return None
    duty = np.where(whole >= SIGN, 1.0, -1.0) * size / FULL
    informative = known & on & np.isfinite(error) & (size < FULL) & (size > 0)
    if informative.sum() < c.fewest / 2 or np.std(error[informative]) == 0 or np.std(duty[informative]) == 0:
        return None
    follows = float(np.corrcoef(duty[informative], error[informative])[0, 1])
    return None if abs(follows) < c.follows else np.asarray(np.where(known, np.copysign(1.0, follows) * duty, np.nan))


@dataclass(frozen=True)
class RegisterLog:
    """The log of one servo: goal, position [rad] and duty (N,) in rows at times (N,) [s], the rows in which torque was on, and
    its nominal gain [duty/rad]."""

    time: Array
    goal: Array
    position: Array
    duty: Array
    on: Mask
    gain: float


def law_of(logs: Sequence[RegisterLog], c: RegisterChecks = REGISTER) -> RegisterLaw | None:
    """The law of one servo's duty in several logs, whose gains have the nominal ratios; None if the logs do not determine one."""
    used = [log.on & np.isfinite(log.duty) & np.isfinite(log.goal) & np.isfinite(log.position)
            & (log.time > log.time[0] + c.start) for log in logs]
    kept = [(log, rows) for log, rows in zip(logs, used) if rows.sum() >= c.fewest]
    slopes = [_slope(log, rows) / log.gain for log, rows in kept]
    if not slopes or float(np.median(slopes)) <= 0:
        return None
    gain = float(np.median(slopes))

    def residuals(x: Array) -> Array:
        delay, slowness, p, zone, k, fast = x.tolist()
        out = []
        for log, rows in kept:
            steep = k * gain * log.gain
            at = log.time + fast * (log.time - log.time[0]) - delay
            e = ramp_goals(log.time, log.goal, at, 1.0 / max(slowness, 1e-6)) - log.position
            law = np.sign(e) * steep * np.maximum(np.abs(e) - zone, 0.0) + p * np.tanh(e / c.soft)
            out.append((log.duty - np.clip(law, -1.0, 1.0))[rows] / steep)
        return np.asarray(np.concatenate(out) / c.error)

    low, high = np.array([(-0.02, 0.3), (1e-3, 1.0), (0.0, 0.3), (0.0, 0.05), (0.3, 3.0), (-0.05, 0.05)]).T
    scale = np.array([0.01, 0.05, 0.01, 1e-3, 0.1, 0.003])
    begins = [np.array([d, 1.0 / v, c.duty, 1e-3, 1.0, 0.0]) for d in c.delays for v in c.ramps]
    begins.sort(key=lambda x: float(np.log1p(residuals(x) ** 2).sum()))
    def slopes_of(x: Array) -> Array:
        return _differences(residuals, x, scale)

    from scipy.optimize import least_squares  # for logs with such a register alone

    fits = [least_squares(residuals, x, jac=slopes_of, bounds=(low, high), loss="cauchy", x_scale=scale) for x in begins[:2]]
    fit = min(fits, key=lambda f: float(f.cost))
    missed = float(np.median(np.abs(fit.fun))) * c.error
    behind = np.concatenate([np.abs(log.duty[rows]) / (fit.x[4] * gain * log.gain) for log, rows in kept])
    if missed > max(c.missed, c.share * float(np.median(behind))):
        return None
    J = np.asarray(fit.jac, dtype=float)
    spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(J.T @ J)), 0.0))
    delay, slowness, p, zone, k, fast = fit.x.tolist()
    ramp, sd = 1.0 / slowness, float(spread[1] / slowness**2)
    identified = sd < c.sure * ramp
    errors = {"gain": gain * float(spread[4]), "delay": float(spread[0]), "ramp": sd if identified else np.inf,
              "minimum_duty": float(spread[2]), "dead_zone": float(spread[3]),
              "rate": float(spread[5])}
    return RegisterLaw(gain * k, delay, ramp if identified else np.inf, p, zone, 1.0 / (1.0 + fast), missed, errors)


def _differences(residuals: Callable[[Array], Array], x: Array, scale: Array) -> Array:
    """Slopes by central differences, wide enough for a goal that is held from row to row."""
    columns = []
    for k, step in enumerate(0.1 * scale):
        way = np.eye(len(x))[k] * step
        columns.append((residuals(x + way) - residuals(x - way)) / (2 * step))
    return np.stack(columns, axis=1)


def _slope(log: RegisterLog, rows: Mask) -> float:
    error = log.goal - log.position
    free = rows & (np.abs(log.duty) < 0.9)
    ratio = log.duty[free] / np.where(np.abs(error[free]) > 1e-3, error[free], np.nan)
    return float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else 0.0


def ramp_goals(sent: Array, goal: Array, at: Array, speed: float) -> Array:
    """A servo's internal goal (M,) [rad] at times `at` (M,) [s] if it moves at no more than `speed` [rad/s] towards goals (N,)
    [rad], sent at times (N,) [s] and each held until the next."""
    if np.isinf(speed):
        return np.asarray(goal[np.clip(np.searchsorted(sent, at, side="right") - 1, 0, None)])
    times, values = [float(sent[0])], [float(goal[0])]
    now = values[0]
    for t, target, until in zip(sent.tolist(), goal.tolist(), [*sent[1:].tolist(), float(max(at[-1], sent[-1])) + 1.0]):
        there = t + abs(target - now) / speed
        if there < until:
            now = target
            times += [there, until]
            values += [now, now]
        else:
            now += np.copysign(speed * (until - t), target - now)
            times.append(until)
            values.append(now)
    return np.interp(at, times, values)
