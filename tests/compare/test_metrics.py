"""Numbers of one take and of two, on signals whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from workbench.compare import metrics

TIME = np.arange(0, 4, 1 / 120)
ALL = np.ones(len(TIME), dtype=bool)


def test_rms_leaves_gaps_out():
    x = np.array([[3.0, np.nan], [4.0, np.nan], [np.nan, np.nan]])
    np.testing.assert_allclose(metrics.rms(x), [np.sqrt(12.5), np.nan])


def test_noise_is_that_of_the_rest_alone():
    rng = np.random.default_rng(3)
    x = rng.normal(0.2, 0.01, (2000, 2))
    x[1000:] += 5
    resting = np.arange(2000) < 1000
    np.testing.assert_allclose(metrics.noise_at_rest([x[resting]]), 0.01, rtol=0.1)
    np.testing.assert_allclose(metrics.noise_at_rest([x[resting], x[~resting]]), 0.01, rtol=0.05)  # each about its own mean
    assert np.isnan(metrics.noise_at_rest([x[:4]])).all()


def test_noise_of_short_rests_is_unbiased():
    rests = list(np.random.default_rng(4).normal(0, 1, (4000, 6, 1)))
    assert metrics.noise_at_rest(rests)[0] == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("late", [0.0, 0.0213, -0.05])
def test_lag_is_found_between_frames_through_noise_and_gaps(late):
    rng = np.random.default_rng(5)
    b = np.column_stack([np.sin(7 * TIME), np.sin(5 * TIME) + 0.3 * np.sin(11 * TIME), 0 * TIME])
    a = np.column_stack([np.sin(7 * (TIME - late)), np.sin(5 * (TIME - late)) + 0.3 * np.sin(11 * (TIME - late)), 0 * TIME])
    a += rng.normal(0, 0.003, a.shape)
    a[100:120] = np.nan
    found = metrics.lag(TIME, a, b, ALL, np.full(3, 0.003))
    np.testing.assert_allclose(found[:2], late, atol=1e-3)
    assert np.isnan(found[2])  # a joint that does not move has no lag


def test_lag_beyond_the_search_is_not_claimed():
    a, b = np.sin(2 * (TIME - 0.6))[:, None], np.sin(2 * TIME)[:, None]
    assert np.isnan(metrics.lag(TIME, a, b, ALL, np.array([0.01]))).all()


def test_correlation():
    a = np.column_stack([np.sin(TIME), np.sin(TIME), np.ones_like(TIME)])
    b = np.column_stack([3 * np.sin(TIME) + 1, -np.sin(TIME), np.sin(TIME)])
    b[50:60] = np.nan
    np.testing.assert_allclose(metrics.correlation(a, b, ALL), [1, -1, np.nan])


def test_heading_counts_turns_and_ignores_tilt():
    yaw = np.linspace(0.3, 9.0, 400)
    rolled = Rotation.from_euler("ZYX", np.column_stack([yaw, 0.2 * np.sin(yaw), 0.3 * np.cos(yaw)]))
    quat = rolled.as_quat(scalar_first=True) * np.where(np.arange(400) % 2, 1, -1)[:, None]
    np.testing.assert_allclose(metrics.heading(quat), yaw, atol=1e-9)
    assert metrics.heading_change(quat, np.linspace(-1, 3, 400)) == pytest.approx(yaw[-1] - yaw[:100].mean(), abs=1e-9)


def test_travelled_is_from_rest_to_the_last_frame_seen():
    p = np.column_stack([np.clip(TIME - 1, 0, None) * 0.1, 0 * TIME, 0 * TIME + 0.2])
    p[-5:] = np.nan
    np.testing.assert_allclose(metrics.displacement(p, TIME - 1), [0.1 * (TIME[-6] - 1), 0, 0], atol=1e-12)


def test_speed_of_a_circle():
    x = 0.3 * np.column_stack([np.cos(TIME), np.sin(TIME)])
    x[200:205] = np.nan
    np.testing.assert_allclose(metrics.speed(TIME, x), 0.3, rtol=2e-3)


def test_smoothness_prefers_one_bell_to_many_and_bears_noise():
    """Balasubramanian et al. 2015: a minimum-jerk reach is about -1.4 and sub-movements lower it."""
    s = np.linspace(0, 1, len(TIME))
    bell = 30 * s**2 * (1 - s) ** 2
    two = np.where(s < 0.5, np.interp(2 * s, s, bell), np.interp(2 * s - 1, s, bell))
    noisy = bell + np.random.default_rng(1).normal(0, 0.01, len(bell))
    smooth = metrics.smoothness(TIME, bell)
    assert smooth == pytest.approx(-1.4, abs=0.1)
    assert metrics.smoothness(TIME, two) < smooth - 0.3
    assert metrics.smoothness(TIME, noisy) == pytest.approx(smooth, abs=0.15)
    assert metrics.smoothness(TIME, 7 * bell) == pytest.approx(smooth)
    assert np.isnan(metrics.smoothness(TIME, 0 * bell))
