"""The start of a servo log: its velocity is estimated only where the first positions move by more than their noise."""

import numpy as np
import pytest

from workbench.recording import read_recording, write_joint_log
from workbench.recording.servo_log.state import state_at
from workbench.recording.white_noise import white_noise

TIME = np.arange(0.0, 2.0, 0.01)
NOISE = 1.5e-3


def start(tmp_path, position):
    write_joint_log(tmp_path / "log.csv", TIME, {"goal.j": np.full_like(TIME, 0.4), "position.j": position})
    (q,), (v,) = state_at(read_recording(tmp_path / "log.csv"), ("j",), 0.0)
    return q, v


@pytest.mark.parametrize("seed", range(5))
def test_a_joint_that_rests_begins_at_rest_whatever_the_noise(tmp_path, seed):
    q, v = start(tmp_path, 0.3 + NOISE * np.random.default_rng(seed).normal(size=len(TIME)))
    assert q == pytest.approx(0.3, abs=5 * NOISE)
    assert v == 0.0


def test_a_joint_that_sets_out_from_rest_begins_at_rest(tmp_path):
    _, v = start(tmp_path, 0.3 + np.minimum(25.0 * TIME**2, 0.1) + NOISE * np.random.default_rng(0).normal(size=len(TIME)))
    assert v == 0.0


def test_a_joint_that_moves_begins_as_fast_as_it_is(tmp_path):
    _, v = start(tmp_path, 0.3 + 0.7 * np.sin(4.0 * TIME) + NOISE * np.random.default_rng(0).normal(size=len(TIME)))
    assert v == pytest.approx(2.8, rel=0.2)


def test_white_noise_is_told_beside_a_motion_and_a_gap():
    values = np.sin(3.0 * TIME) + NOISE * np.random.default_rng(1).normal(size=len(TIME))
    values[50:60] = np.nan
    assert white_noise(values) == pytest.approx(NOISE, rel=0.3)
    assert np.isnan(white_noise(values[:3]))
