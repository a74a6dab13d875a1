"""Intervals of numbers, in the contract's units."""

import numpy as np
import pytest

from workbench.effects.registry import known_effects
from workbench.gap.candidates import Candidate
from workbench.gap.conclusions import LEAST_RELATIVE, Z90, estimates


def test_where_a_mass_is_errs_with_its_moment_and_with_the_mass_together():
    """A moment m = mass * place: its variance at a known mass, and what the mass alone would move it by if they err together."""
    c = Candidate.of(known_effects()["payload"], ("body_link",), (0.0, 0.0, 0.0, 0.0))
    x = np.array([4.0, 4.0, 8.0, -4.0])
    alone = estimates(c, x, np.diag([0.0, 0.04, 0.0, 0.0]))["position"]
    assert alone.value == pytest.approx((0.02, 0.04, -0.02))
    assert alone.high[0] - alone.value[0] == pytest.approx(Z90 * 0.2 / 4 * 0.02, rel=1e-3)
    assert alone.high[1] - alone.value[1] == pytest.approx(Z90 * LEAST_RELATIVE * 0.04, rel=1e-3)
    same_place = 0.25 * np.outer(x, x) / 16
    together = estimates(c, x, same_place)
    assert together["mass"].high - together["mass"].value == pytest.approx(Z90 * 0.5 * 0.05, rel=1e-3)
    assert together["position"].high[0] - 0.02 == pytest.approx(Z90 * LEAST_RELATIVE * 0.02, rel=1e-3)


def test_no_number_is_known_better_than_a_share_of_what_it_differs_from_neutral_by():
    c = Candidate.of(known_effects()["clock_rate"], (), (1.0,))
    told = estimates(c, np.array([1.0]), np.zeros((1, 1)))["ratio"]
    assert told.high - told.value == pytest.approx(Z90 * LEAST_RELATIVE * abs(told.value - 1.0), rel=1e-6)
