"""Windows of floating-base takes: their starts, the states read there, and the frames ignored after them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from workbench.identify.options import PROBLEM
from workbench.identify.shooting import base_states, edges, unsettled_frames
from workbench.recording.take import Take

SPEED, TURNING = np.array([0.05, -0.02, 0.01]), np.array([0.1, -0.2, 0.8])


@pytest.fixture
def walk() -> Take:
    """Goes straight on and turns at a steady rate, at 120 Hz, from the first command at 0.25 s on."""
    time = np.arange(600) / 120.0
    return Take(name="walk", source="test", time=time, joints=(), q=np.zeros((600, 0)), starts_at=0.25,
                p_WB=time[:, None] * SPEED, quat_WB=Rotation.from_rotvec(time[:, None] * TURNING).as_quat(scalar_first=True))


def test_pose_and_velocity_are_read_off_where_windows_begin(walk: Take):
    states = base_states(walk)
    assert states is not None
    assert np.allclose(states.times, edges(walk.since_start), atol=1 / 120)
    assert np.allclose(states.v, SPEED, atol=1e-6)
    assert np.allclose(states.w, TURNING, atol=1e-6)
    turned = Rotation.from_rotvec((states.times[:, None] + walk.starts_at) * TURNING)
    assert (Rotation.from_quat(states.quat, scalar_first=True) * turned.inv()).magnitude().max() < 1e-6


def test_noise_of_cameras_is_smoothed(walk: Take):
    rng = np.random.default_rng(0)
    noisy = replace(walk, p_WB=walk.p_WB + 1e-4 * rng.standard_normal((600, 3)))
    states = base_states(noisy)
    assert states is not None
    assert np.abs(states.v - SPEED).max() < 0.01  # a difference of two frames is off by 0.017


def test_a_window_whose_beginning_was_not_seen_goes_on_from_the_one_before(walk: Take):
    p_WB = walk.p_WB.copy()
    p_WB[np.abs(walk.since_start - 2 * PROBLEM.window) < 0.01] = np.nan
    states, whole = base_states(replace(walk, p_WB=p_WB)), base_states(walk)
    assert states is not None
    assert whole is not None
    assert len(states.times) == len(whole.times) - 1
    assert np.abs(states.times - 2 * PROBLEM.window).min() > PROBLEM.window / 2


@pytest.mark.parametrize("changes", [{"base": "fixed"}, {"p_WB": None}, {"quat_WB": None}])
def test_what_is_held_or_was_not_tracked_is_not_put_back(walk: Take, changes: dict[str, object]):
    assert base_states(replace(walk, **changes)) is None  # type: ignore[arg-type]


def test_frames_after_an_edge_tell_nothing_until_feet_have_found_the_floor(walk: Take):
    states = base_states(walk)
    assert states is not None
    since = walk.since_start
    told = since[~unsettled_frames(states, since)]
    after = told[:, None] - states.times
    assert not ((after >= 0) & (after < PROBLEM.settles)).any()
    assert len(told) > 0.75 * len(since)
