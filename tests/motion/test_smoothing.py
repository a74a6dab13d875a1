"""Interpolation and smoothing, against polynomials and signals whose derivatives are known."""

import numpy as np
import pytest
from scipy.signal import savgol_filter

from workbench.motion import (
    Trajectory,
    filter_derivatives,
    inconsistency,
    interpolate,
    interpolate_motion,
    load_motion,
    low_pass,
    savitzky_golay,
)
from workbench.robot import data_file

WALK = load_motion(data_file("robotis_walk.csv"))


def sine(step: float = 1e-4, rate: float = 2 * np.pi) -> Trajectory:
    t = np.arange(0, 2, step)[:, None]
    return Trajectory(t[:, 0], ("a",), np.sin(rate * t), rate * np.cos(rate * t), -rate**2 * np.sin(rate * t))


@pytest.mark.parametrize("knots", ["smooth", "rest"])
def test_interpolation_passes_the_poses_at_their_times(knots: str) -> None:
    path = interpolate_motion(WALK, cycles=3, knots=knots)  # type: ignore[arg-type]
    assert path.step == pytest.approx(1e-4)
    assert path.time[-1] == pytest.approx(3 * 0.468)
    for cycle in range(3):
        at = np.round((WALK.times + cycle * 0.468) / 1e-4).astype(int)
        assert path.q[at] == pytest.approx(WALK.angles, abs=1e-9)
        assert knots == "smooth" or np.abs(path.v[at]).max() < 1e-6


def test_a_cubic_is_reproduced_and_its_cycle_is_smooth() -> None:
    t = np.linspace(0, 1, 9)
    cubic = interpolate(t, ("a",), (3 * t**2 - 2 * t**3)[:, None])  # at rest at both ends
    s = cubic.time
    assert cubic.q[:, 0] == pytest.approx(3 * s**2 - 2 * s**3, abs=1e-12)
    assert cubic.v[:, 0] == pytest.approx(6 * s - 6 * s**2, abs=1e-10)
    assert cubic.a[:, 0] == pytest.approx(6 - 12 * s, abs=1e-8)
    walk = interpolate_motion(WALK, cycles=2)
    assert np.abs(np.diff(walk.v, axis=0)).max() <= 1.01e-4 * np.abs(walk.a).max()  # no jump in speed, nor at the seam
    assert walk.a[0] == pytest.approx(walk.a[-1], abs=1e-6)


def test_savitzky_golay_keeps_a_cubic_and_has_no_lag() -> None:
    t = np.linspace(0, 1, 10001)[:, None]
    zero = np.zeros_like(t)
    smooth = savitzky_golay(Trajectory(t[:, 0], ("a",), t**3 - t, zero, zero), window=1001)
    assert smooth.q == pytest.approx(t**3 - t, abs=1e-9)
    assert smooth.v == pytest.approx(3 * t**2 - 1, abs=1e-7)
    assert smooth.a == pytest.approx(6 * t, abs=1e-5)
    noisy = sine()
    rng = np.random.default_rng(0)
    noisy = Trajectory(noisy.time, noisy.joints, noisy.q + rng.normal(0, 0.01, noisy.q.shape), noisy.v, noisy.a)
    smooth = savitzky_golay(noisy, window=2001)
    assert np.abs(smooth.q - sine().q)[1000:-1000].max() < 0.003
    assert np.abs(smooth.v - sine().v)[1000:-1000].max() < 0.1
    assert inconsistency(smooth).max() < 0.002


def test_derivatives_filtered_alone_drift_from_the_angle() -> None:
    """The thesis's own filter on cubics that rest at each pose: the speed is no longer the angle's derivative."""
    raw = interpolate_motion(WALK, cycles=4, knots="rest")
    filtered = filter_derivatives(raw, window=1001)
    assert np.array_equal(filtered.q, raw.q)
    assert np.abs(filtered.v).max() < np.abs(raw.v).max()
    assert inconsistency(raw).max() < 1e-5
    assert inconsistency(filtered).max() > np.radians(1)
    assert inconsistency(savitzky_golay(raw, window=1001)).max() < 0.4 * inconsistency(filtered).max()


def test_low_pass_lags_by_twice_its_time_constant() -> None:
    """Against the exact response of 1/(Ts+1)^2 to a sine, after it has settled."""
    T, rate = 0.02, 2 * np.pi
    slow = low_pass(sine(), T)
    settled = slow.time > 1
    shift = 2 * np.arctan(rate * T)
    exact = np.sin(rate * slow.time - shift) / (1 + (rate * T) ** 2)
    assert slow.q[settled, 0] == pytest.approx(exact[settled], abs=1e-6)
    speed = rate * np.cos(rate * slow.time - shift) / (1 + (rate * T) ** 2)
    assert slow.v[settled, 0] == pytest.approx(speed[settled], abs=1e-5)
    assert slow.a[settled, 0] == pytest.approx(-(rate**2) * exact[settled], abs=1e-4)
    assert shift / rate == pytest.approx(2 * T, rel=0.01)
    assert low_pass(sine(), 1e-5).q[settled] == pytest.approx(sine().q[settled], abs=1e-3)


def test_ramp_response_of_the_low_pass() -> None:
    T = 0.02
    t = np.arange(0, 0.2, 1e-3)
    u = t[:, None]
    ramp = low_pass(Trajectory(t, ("a",), u + 5, u, u), T)
    assert ramp.q[:, 0] == pytest.approx(5 + t - 2 * T + (t + 2 * T) * np.exp(-t / T), abs=1e-9)
    assert ramp.v[:, 0] == pytest.approx(1 - (1 + t / T) * np.exp(-t / T), abs=1e-9)
    assert ramp.a[:, 0] == pytest.approx(t / T**2 * np.exp(-t / T), abs=1e-6)


def test_savitzky_golay_against_scipy_and_where_scipy_fails() -> None:
    rng = np.random.default_rng(1)
    y = rng.normal(size=(400, 2))
    path = Trajectory(np.arange(400) * 0.01, ("a", "b"), y, y, y)
    smooth = savitzky_golay(path, window=91, order=4)
    for k, found in enumerate((smooth.q, smooth.v, smooth.a)):
        assert found == pytest.approx(savgol_filter(y, 91, 4, deriv=k, delta=0.01, axis=0), rel=1e-6, abs=1e-9)
    t = np.linspace(-1, 1, 20001)[:, None]
    quintic = savitzky_golay(Trajectory(t[:, 0], ("a",), t**5, t, t), window=5001, order=5)
    assert quintic.q == pytest.approx(t**5, abs=1e-9)
    assert quintic.a == pytest.approx(20 * t**3, abs=1e-6)


@pytest.mark.parametrize("window", [90, 3, 99999])
def test_impossible_windows(window: int) -> None:
    with pytest.raises(ValueError, match="window"):
        savitzky_golay(sine(), window)
    with pytest.raises(ValueError, match="window"):
        filter_derivatives(sine(), window)
    with pytest.raises(ValueError, match="time constant"):
        low_pass(sine(), 0.0)
