"""When the first command went out, where the robot does not move as predicted."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.motion.commands import Commands
from workbench.recording.mocap.start import find_start, lagged_reference

JOINTS = ("one", "two", "three")


def test_a_robot_that_rests_at_the_end_is_not_taken_for_one_that_has_not_begun():
    """At wrong speeds nothing fits; rest at the end of the take fits the rest before the first pose."""
    goals = np.deg2rad([[0, 0, 0], [30, -30, 20], [-30, 30, -20], [0, 0, 0]])
    commands = Commands(times=np.array([0.0, 0.5, 1.5, 2.5]), joints=JOINTS, goals=goals, speeds=np.full((4, 3), 0.6),
                        enabled=np.ones((4, 3), dtype=bool), end=3.5, poses=np.arange(4))
    wrong = replace(commands, goals=goals[:, [1, 2, 0]], speeds=np.zeros((4, 3)))
    recorded = lagged_reference(wrong)
    time = np.arange(0, 6.0, 1 / 120)
    q = np.stack([np.interp(time - 0.4, recorded.time, c) for c in recorded.q.T], axis=1)
    found = find_start(time, JOINTS, q, np.full(3, 1e-3), lagged_reference(commands))
    assert found.time == pytest.approx(0.4, abs=0.2)


def test_joints_that_a_turned_marker_frame_shows_off_zero_are_not_taken_for_moving():
    goals = np.deg2rad([[0, 0, 0], [30, -30, 20], [0, 0, 0]])
    commands = Commands(times=np.array([0.0, 0.5, 1.5]), joints=JOINTS, goals=goals, speeds=np.full((3, 3), 0.6),
                        enabled=np.ones((3, 3), dtype=bool), end=2.5, poses=np.arange(3))
    predicted = lagged_reference(commands)
    time, noise = np.arange(0, 4.0, 1 / 120), 2e-3
    q = np.stack([np.interp(time - 0.613, predicted.time, c) for c in predicted.q.T], axis=1)
    q += np.random.default_rng(0).normal(0, noise, q.shape) + np.deg2rad([1.05, -1.0, 0.0])
    found = find_start(time, JOINTS, q, np.full(3, noise), predicted)
    assert found.time == pytest.approx(0.613, abs=0.002)
    assert max(abs(s - 0.613) for s in found.by_joint.values()) < 0.004


def test_where_speeds_are_not_those_predicted_joints_setting_out_tell_the_start():
    """A slow joint laid over a fast one fits best far too late, and they all agree on that."""
    goals = np.deg2rad([[0, 0, 0], [40, -40, 40], [0, 0, 0]])
    commands = Commands(times=np.array([0.0, 1.0, 2.5]), joints=JOINTS, goals=goals, speeds=np.full((3, 3), 2.0),
                        enabled=np.ones((3, 3), dtype=bool), end=4.0, poses=np.arange(3))
    slow = lagged_reference(replace(commands, speeds=np.full((3, 3), 0.35)))
    time = np.arange(0, 6.0, 1 / 120)
    q = np.stack([np.interp(time - 0.613, slow.time, c) for c in slow.q.T], axis=1)
    found = find_start(time, JOINTS, q, np.full(3, 1e-3), lagged_reference(commands))
    assert found.time == pytest.approx(0.613, abs=0.03)
