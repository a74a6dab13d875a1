"""From poses to smooth trajectories with derivatives, in the thesis's ways (chapters 6.7, 6.8) and in better ones."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.signal import lfilter, savgol_filter

from workbench.motion.motion import Motion

Array = NDArray[np.float64]
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
    if knots == "rest":
        curve: CubicHermiteSpline | CubicSpline = CubicHermiteSpline(time, angles, np.zeros_like(angles))
    elif periodic:  # first and last row agree up to rounding, which the spline insists on exactly
        curve = CubicSpline(time, np.vstack([angles[:-1], angles[:1]]), bc_type="periodic")
    else:
        curve = CubicSpline(time, angles, bc_type="clamped")
    samples = time[0] + step * np.arange(int((time[-1] - time[0]) / step + 1e-6) + 1)
    return Trajectory(samples, joints, curve(samples), curve(samples, 1), curve(samples, 2))


def interpolate_motion(motion: Motion, cycles: int = 1, step: float = 1e-4, knots: Knots = "smooth") -> Trajectory:
    """A motion, looped, as a trajectory from its first row; periodic if its cycle closes."""
    starts = motion.duration * np.arange(cycles)
    times = np.concatenate([[0.0], (starts[:, None] + (motion.times[1:] - motion.times[0])).ravel()])
    angles = np.vstack([motion.angles[:1], np.tile(motion.angles[1:], (cycles, 1))])
    return interpolate(times, motion.joints, angles, step, knots, periodic=motion.closes)


def savitzky_golay(trajectory: Trajectory, window: int, order: int = 3) -> Trajectory:
    """Angles smoothed over `window` samples (odd), derivatives from the same local polynomials; no lag."""
    _check(trajectory, window, order)

    def derivative(k: int) -> Array:
        return np.asarray(savgol_filter(trajectory.q, window, order, deriv=k, delta=trajectory.step, axis=0))

    return replace(trajectory, q=derivative(0), v=derivative(1), a=derivative(2))


def filter_derivatives(trajectory: Trajectory, window: int, order: int = 3) -> Trajectory:
    """The thesis's own filter (6.7): velocity and acceleration each smoothed for themselves, angles left alone.

    Nothing then makes v the derivative of q: the caller can measure by how much it is not (`inconsistency`).
    """
    _check(trajectory, window, order)
    v, a = (np.asarray(savgol_filter(y, window, order, axis=0)) for y in (trajectory.v, trajectory.a))
    return replace(trajectory, v=v, a=a)


def low_pass(trajectory: Trajectory, time_constant: float) -> Trajectory:
    """Simulink's converter (the thesis's "MATLAB filter"): q through 1/(T s + 1)^2 [T in s], with the filter's own derivatives.

    It lags by 2 T. Starts settled at the first sample; the input is held over each step.
    """
    if not time_constant > 0:
        raise ValueError(f"expected a positive time constant, got {time_constant}")
    h, T = trajectory.step, time_constant
    p = float(np.exp(-h / T))
    # Exact for a held input, by z-transform of the step responses of 1/(Ts+1)^2 and s/(Ts+1)^2; poles p twice.
    denominator = [1, -2 * p, p * p]
    to_q = [0, 1 - p - h / T * p, p * p - p + h / T * p]
    to_v = [0, h / T**2 * p, -h / T**2 * p]
    u = trajectory.q - trajectory.q[0]
    q, v = lfilter(to_q, denominator, u, axis=0), lfilter(to_v, denominator, u, axis=0)
    return replace(trajectory, q=q + trajectory.q[0], v=v, a=(u - 2 * T * v - q) / T**2)


def inconsistency(trajectory: Trajectory) -> Array:
    """How far the angle strays from the integral of the velocity, peak to peak (n,) [rad]; 0 if v is the derivative."""
    integral = cumulative_trapezoid(trajectory.v, dx=trajectory.step, axis=0, initial=0)
    return np.asarray(np.ptp(trajectory.q - integral, axis=0))


def _check(trajectory: Trajectory, window: int, order: int) -> None:
    if window % 2 == 0 or not order < window <= len(trajectory.time):
        longest = len(trajectory.time)
        raise ValueError(f"window: expected an odd number above order {order}, at most {longest} samples, got {window}")
