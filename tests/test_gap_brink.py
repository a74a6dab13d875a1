"""A walk that next to nothing sends elsewhere shows no gap from then on."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from workbench.gap.brink import before, judged_until, next_to
from workbench.robot import Ground, puppy_model

TIME = np.arange(0.0, 5.0, 0.01)
BRINK = 3.0


class Walks:
    """A jury of one take of two channels, on the ground or not, whose robots next to the model part from it like this."""

    def __init__(self, apart, ground=True):
        self.apart, self.ground = apart, ground
        self.evidence = (SimpleNamespace(channels=("hip", "knee"), since=TIME, moving=TIME >= 0, frame_time=0.01),)

    def walks(self, takes):
        return self.ground

    def residuals(self, questions):
        shares = np.linspace(0.2, 1.0, len(questions))
        return [{0: self.left + share * self.apart} for share in shares]

    def judged(self, left):
        self.left = left
        return judged_until(self, puppy_model(), {0: left}, (0,))


def noise():
    return np.random.default_rng(5).normal(size=(len(TIME), 2))


def from_then_on(start, size):
    out = np.zeros((len(TIME), 2))
    out[start <= TIME, 1] = size
    return out


def test_what_comes_after_the_brink_is_no_gap():
    (until,) = Walks(from_then_on(BRINK, 6.0)).judged(noise() + from_then_on(BRINK + 0.1, 8.0)).values()
    assert until == pytest.approx(BRINK, abs=0.1)


def test_what_was_missing_before_is_a_gap():
    assert Walks(from_then_on(BRINK, 6.0)).judged(noise() + from_then_on(1.0, 8.0)) == {}


def test_a_robot_that_goes_its_way_whatever_its_neighbours_weigh_has_a_gap():
    assert Walks(from_then_on(BRINK, 0.9)).judged(noise() + from_then_on(BRINK, 8.0)) == {}


def test_a_walk_without_a_gap_is_judged_whole():
    assert Walks(from_then_on(BRINK, 6.0)).judged(noise()) == {}


def test_with_the_base_held_nothing_is_left_to_chance():
    assert Walks(from_then_on(BRINK, 6.0), ground=False).judged(noise() + from_then_on(BRINK + 0.1, 8.0)) == {}


def test_before_ends_with_the_time_asked_for():
    (take,) = Walks(np.zeros(1)).evidence
    kept = np.isfinite(before(take, noise(), 2.0)).all(axis=1)
    assert np.array_equal(kept, TIME <= 2.0)


def test_robots_next_to_a_model_differ_from_it_and_from_each_other():
    model = puppy_model()
    near = next_to(replace(model, ground=Ground(friction=0.6)))
    assert len({m.sha256 for m in (model, *near)}) == 1 + 7
    assert [m.ground.friction for m in near[:2]] == pytest.approx([0.57, 0.63])
    assert len(next_to(replace(model, ground=Ground()))) == 5  # the SDF's own friction is not known here
