"""How two vocabularies are held against each other on stretches that no fit saw."""

from types import SimpleNamespace

import numpy as np

from studies.effect_left_out import Asked, by_accident, unseen_squares


def told(scale, seed=0):
    """A result of one take: 20 s at 50 Hz, two channels, the second half unseen."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 0.02)
    take = SimpleNamespace(time=time, judged=time >= 10.0, after=scale * rng.normal(size=(len(time), 2)))
    return SimpleNamespace(takes=(take,))


def test_only_unseen_stretches_count():
    (take,) = told(1.0).takes
    take.after[take.time < 10.0] = 1e3
    squares = unseen_squares(take)
    assert len(squares) == 20
    assert np.mean(squares) == np.clip(np.mean(squares), 40, 60)  # 25 frames of two channels


def test_a_model_that_leaves_more_in_most_blocks_is_no_accident_and_noise_is():
    assert by_accident(told(1.0, 1), told(1.3, 2)) < 1e-3
    assert by_accident(told(1.0, 1), told(1.0, 2)) > 0.01
    assert by_accident(told(1.0), told(1.0)) == 1.0
    assert by_accident(told(1.3, 1), told(1.0, 2)) > 0.5


def test_explained_is_wrong_only_where_the_truth_tells_it_better():
    def asked(verdict, chance):
        return Asked("s", "backlash", verdict, (), (2.0, 1.5, 1.0), chance, 1.0)

    assert asked("explained", 1e-6).wrongly_explained
    assert "WRONG" in asked("explained", 1e-6).line()
    assert not asked("explained", 0.2).wrongly_explained
    assert not asked("partly_explained", 1e-6).wrongly_explained
