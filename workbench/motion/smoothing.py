"""From poses to smooth trajectories with derivatives, in the thesis's ways (chapters 6.7, 6.8) and in better ones."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from workbench.motion.motion import Motion
from workbench.types import Array

Knots = Literal["smooth", "rest"]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Angles at even steps with two derivatives. time: (N,) [s]. q, v, a: (N, n) [rad, rad/s, rad/s^2]."""

    time: Array
    joints: tuple[str, ...]
    q: Array
    v: Array
    a: Array

    @property
    def step(self) -> float:
        """Time between samples [s]."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    def column(self, joint: str) -> int:
        """Index of a joint's column."""
        return self.joints.index(joint)


def interpolate(
    time: Array, joints: tuple[str, ...], angles: Array, step: float = 1e-4, knots: Knots = "smooth",
    periodic: bool = False,
) -> Trajectory:
    """Piecewise cubics through angles (K, n) [rad] at times (K,) [s], sampled every `step` [s].

    knots: "smooth", a spline with two continuous derivatives (at rest at both ends, or periodic); "rest", velocity zero
    at every knot, which is what MATLAB's cubicpolytraj does unless it is given velocities.
    """
    from scipy.interpolate import CubicHermiteSpline, CubicSpline

    if knots == "rest":
        curve: CubicHermiteSpline | CubicSpline = CubicHermiteSpline(time, angles, np.zeros_like(angles))
    elif periodic:  # first and last row agree up to rounding, which the spline insists on exactly
        curve = CubicSpline(time, np.vstack([angles[:-1], angles[:1]]), bc_type="periodic")
    else:
        curve = CubicSpline(time, angles, bc_type="clamped")
    samples = time[0] + step * np.arange(int((time[-1] - time[0]) / step + 1e-6) + 1)
    return Trajectory(samples, joints, curve(samples), curve(samples, 1), curve(samples, 2))


def interpolate_motion(motion: Motion, cycles: int = 1, step: float = 1e-4, knots: Knots = "smooth") -> Trajectory:
    """A motion, looped, as a trajectory from its first row; periodic if its cycle closes. Start and stop are followed once."""
    if motion.start or motion.stop:
        return interpolate_motion(motion.unrolled(cycles), 1, step, knots)
    starts = motion.duration * np.arange(cycles)
    times = np.concatenate([[0.0], (starts[:, None] + (motion.times[1:] - motion.times[0])).ravel()])
    angles = np.vstack([motion.angles[:1], np.tile(motion.angles[1:], (cycles, 1))])
    return interpolate(times, motion.joints, angles, step, knots, periodic=motion.closes)


def savitzky_golay(trajectory: Trajectory, window: int, order: int = 3) -> Trajectory:
    """Angles smoothed over `window` samples (odd), derivatives from the same local polynomials; no lag.

    Savitzky and Golay, Analytical Chemistry 36 (1964) 1627; the first and last half window take the polynomial of the first and
    last whole one.
    """
    q, v, a = (_local_polynomial(trajectory.q, window, order, k, trajectory.step) for k in range(3))
    return replace(trajectory, q=q, v=v, a=a)


def filter_derivatives(trajectory: Trajectory, window: int) -> Trajectory:
    """The thesis's own filter (6.7): velocity and acceleration each smoothed separately by cubics over `window` samples (odd),
    angles unchanged.

    Then v is not exactly the derivative of q: `inconsistency` measures the difference.
    """
    v, a = (_local_polynomial(y, window, 3, 0, trajectory.step) for y in (trajectory.v, trajectory.a))
    return replace(trajectory, v=v, a=a)


def low_pass(trajectory: Trajectory, time_constant: float) -> Trajectory:
    """Simulink's converter (the thesis's "MATLAB filter"): q through 1/(T s + 1)^2, with the filter's own derivatives.

    time_constant: T [s]. It lags by 2 T. The filter starts settled at the first sample.
    """
    if not time_constant > 0:
        raise ValueError(f"expected a positive time constant, got {time_constant}")
    T = time_constant
    u = trajectory.q - trajectory.q[0]

    from scipy.signal import cont2discrete, lfilter  # a second of imports, which most verbs do without

    def respond(*numerator: float) -> Array:
        b, a, _ = cont2discrete((numerator, (T**2, 2 * T, 1.0)), trajectory.step, method="foh")  # type: ignore[call-overload]
        return np.asarray(lfilter(np.ravel(b), a, u, axis=0))

    q, v = respond(1.0), respond(1.0, 0.0)
    return replace(trajectory, q=q + trajectory.q[0], v=v, a=(u - 2 * T * v - q) / T**2)


def inconsistency(trajectory: Trajectory) -> Array:
    """How far the angle strays from the integral of the velocity, peak to peak (n,) [rad]; 0 if v is the derivative."""
    from scipy.integrate import cumulative_trapezoid

    integral = cumulative_trapezoid(trajectory.v, dx=trajectory.step, axis=0, initial=0)
    return np.asarray(np.ptp(trajectory.q - integral, axis=0))


def _local_polynomial(y: Array, window: int, order: int, derivative: int, step: float) -> Array:
    """Derivative of the polynomials fitted to the window about each row of y (N, n).

    In abscissae scaled to -1..1: scipy's savgol_filter, unscaled, silently returns zeros from order 5 and 1001 samples on.
    """
    from scipy.signal import oaconvolve

    if window % 2 == 0 or not 0 < order < window <= len(y):
        raise ValueError(f"window: expected an odd number above the order {order} and at most {len(y)} samples, got {window}")
    if derivative > order:
        return np.zeros_like(y)
    half = window // 2
    x = np.arange(-half, half + 1) / half
    fit = np.linalg.pinv(np.vander(x, order + 1, increasing=True))  # samples to coefficients
    scale = 1 / (half * step) ** derivative
    centre = fit[derivative] * math.factorial(derivative) * scale
    out = np.empty_like(y)
    out[half:len(y) - half] = oaconvolve(y, centre[::-1, None], mode="valid", axes=0)
    for edge, at, to in ((y[:window], x[:half], out[:half]), (y[-window:], x[half + 1:], out[len(y) - half:])):
        to[:] = polyval(at, polyder(fit @ edge, derivative)).T * scale
    return out
