"""Trials that choose a gait."""

from __future__ import annotations

import numpy as np
import pytest

from workbench.files import InputError
from workbench.gait.adapt import TrialChooser

NUMBERS = np.array([(turn, pace) for turn in np.linspace(-0.15, 0.15, 5) for pace in np.linspace(0.5, 1.25, 4)])


def test_the_first_trial_is_what_the_model_thinks_best_and_a_fall_is_never_tried() -> None:
    predicted = NUMBERS[:, 1].copy()
    predicted[3] = np.nan
    chooser = TrialChooser(NUMBERS, predicted)
    first = chooser.next()
    assert NUMBERS[first, 1] == 1.25
    for _ in range(50):
        chooser.tell(chooser.next(), 0.0)
    assert 3 not in chooser.tried
    assert len(chooser.tried) == 19


def test_three_trials_find_the_good_side_that_the_model_got_wrong() -> None:
    """The model thinks that turning left is slightly better; on the robot it is much worse. Its neighbours are not tried next."""
    predicted = 1.0 + 0.5 * NUMBERS[:, 0]
    real = 0.6 - 3.0 * NUMBERS[:, 0]
    chooser = TrialChooser(NUMBERS, predicted)
    for _ in range(3):
        k = chooser.next()
        chooser.tell(k, real[k])
    assert NUMBERS[chooser.best, 0] <= 0
    assert chooser.tried[chooser.best] > real[int(np.argmax(predicted))] + 0.3


def test_a_trial_changes_what_is_expected_nearby_and_not_far_away() -> None:
    chooser = TrialChooser(NUMBERS, np.ones(len(NUMBERS)))
    chooser.tell(0, 0.4)
    mean, sd = chooser.expected
    assert mean[0] == pytest.approx(0.4, abs=0.05)
    assert mean[1] < 0.85
    assert mean[-1] == pytest.approx(1.0, abs=0.01)
    assert sd[0] < 0.2 * sd[-1]


def test_a_model_that_cannot_walk_at_all_leaves_the_choice_to_the_trials() -> None:
    chooser = TrialChooser(NUMBERS, np.zeros(len(NUMBERS)))
    for speed in (0.01, 0.03, 0.02):
        chooser.tell(chooser.next(), speed)
    assert chooser.tried[chooser.best] == 0.03


def test_nothing_to_try_and_nothing_tried_are_said() -> None:
    with pytest.raises(InputError, match="none to try"):
        TrialChooser(NUMBERS, np.full(len(NUMBERS), np.nan))
    with pytest.raises(InputError, match="at least one trial"):
        _ = TrialChooser(NUMBERS, np.ones(len(NUMBERS))).best
