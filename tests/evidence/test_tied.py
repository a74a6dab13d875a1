"""Gravity against torque: a joint gets one name of a tie, believed by no more than the prior odds of both."""

from dataclasses import replace

import numpy as np
import pytest

from tests.evidence.linear import JOINT, candidate, region
from workbench.identify.evidence.fit import evaluate
from workbench.identify.evidence.hypothesis import Prior, Uncertain, log_odds, start
from workbench.identify.evidence.linearise import extensions
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.tied import as_torque

OPTIONS = EvidenceOptions()
N = 1600


def fitted(sd, size, alike=1.0, name="ground_tilt"):
    """A tilt that acts as torque, apart from a part at right angles to it; a unit of it equals 0.1 of the logarithm."""
    tilt = candidate(name)
    here = replace(region([tilt]), numbers=(Uncertain(JOINT, "torque_at_full_duty", sd),))
    rng = np.random.default_rng(1)
    torque, other = rng.normal(size=(2, N)) * 0.02
    other -= torque * (other @ torque) / (torque @ torque)
    other *= np.linalg.norm(torque) / np.linalg.norm(other)
    does = 0.1 * (np.sqrt(alike) * torque + np.sqrt(1 - alike) * other)
    h = start(here.numbers).with_effect(tilt, np.r_[size, np.zeros(tilt.size - 1)])
    J = np.column_stack([sd * torque, does, *np.zeros((tilt.size - 1, N))])
    return here, evaluate(here, OPTIONS, h, 1e-3 * rng.normal(size=N), J), tilt


def test_what_the_motors_tolerance_covers_is_no_load():
    here, f, c = fitted(sd=0.5, size=3.0)
    tie = as_torque(here, OPTIONS, f, c)
    assert tie.by == pytest.approx(0.3)
    assert tie.similarity == pytest.approx(1.0)
    assert tie.share < 0.1
    assert "35 % more" in tie.sentence
    assert "known weight" in tie.sentence


def test_what_it_does_not_cover_is_one():
    here, f, c = fitted(sd=0.03, size=3.0)
    assert as_torque(here, OPTIONS, f, c).share > 0.99


def test_the_share_is_that_of_the_prior_odds():
    here, f, c = fitted(sd=0.1, size=2.0)
    prior, own = Prior.of(f.hypothesis, OPTIONS), f.hypothesis.slices()[0]
    density = prior.at_center[own].sum() + prior.log(f.hypothesis.theta) - prior.log(prior.center)
    H = (f.J[:, own].T * here.likelihood.precision(f.r, f.discrepancy)) @ f.J[:, own] + np.diag(
        prior.precision(f.hypothesis.theta)[own])
    effect = density + log_odds(1, OPTIONS.expected) + 0.5 * len(H) * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(H)[1]
    assert as_torque(here, OPTIONS, f, c).share == pytest.approx(1 / (1 + np.exp(-0.5 * 2.0**2 - effect)))


def test_the_share_depends_on_the_candidates_and_on_where_the_torque_is_already():
    here, f, c = fitted(sd=0.1, size=2.0)
    here = replace(here, candidates=(c,) * 6)
    moved = f.hypothesis.theta.copy()
    moved[0] = 0.5
    f = replace(f, hypothesis=f.hypothesis.at(moved))
    prior, own = Prior.of(f.hypothesis, OPTIONS), f.hypothesis.slices()[0]
    nothing = moved.copy()
    nothing[own] = prior.center[own]
    H = (f.J[:, own].T * here.likelihood.precision(f.r, f.discrepancy)) @ f.J[:, own] + np.diag(prior.precision(moved)[own])
    effect = (prior.at_center[own].sum() + prior.log(moved) - prior.log(nothing) + log_odds(6, OPTIONS.expected)
              + 0.5 * len(H) * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(H)[1])
    torque = -0.5 * ((0.5 + 2.0) ** 2 - 0.5**2)  # the prior's standard deviation is half of the change that the tilt resembles
    assert as_torque(here, OPTIONS, f, c).share == pytest.approx(1 / (1 + np.exp(torque - effect)))


def test_an_effect_of_no_tie_is_compared_with_no_torque():
    here, f, c = fitted(sd=0.5, size=3.0, name="coulomb_friction")
    assert as_torque(here, OPTIONS, f, c) is None


def test_what_does_something_else_is_tied_to_nothing():
    here, f, c = fitted(sd=0.5, size=3.0, alike=0.3)
    assert as_torque(here, OPTIONS, f, c) is None


def test_a_joint_gets_one_of_a_tie():
    here = region([candidate(name) for name in ("ground_tilt", "supply_voltage", "torque_ceiling", "supply_sag", "backlash")])
    h = start(here.numbers).with_effect(candidate("ground_tilt"), np.ones(2))
    assert {c.name for c in extensions(here, h)} == {"torque_ceiling", "supply_sag", "backlash"}


def test_a_size_is_known_no_better_than_the_torques_that_do_the_same():
    """A tilt of 3 is 0.3 of the logarithm of torque; with 0.06 of that unknown, a fifth of the tilt is."""
    here, f, c = fitted(sd=0.06, size=3.0)
    tie = as_torque(here, OPTIONS, f, c)
    size, vague = f.hypothesis.theta[f.hypothesis.slices()[0]], 4.0 * np.eye(c.size)
    covariance = tie.covariance(1e-6 * np.eye(c.size), size)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(0.2 * 3.0, rel=1e-3)
    assert np.sqrt(covariance[1, 1]) == pytest.approx(1e-3)
    assert tie.covariance(vague, size) == pytest.approx(vague)


def test_a_small_size_is_widened_along_its_own_direction_too():
    here, f, c = fitted(sd=0.06, size=0.5)
    tie, size = as_torque(here, OPTIONS, f, c), f.hypothesis.theta[f.hypothesis.slices()[0]]
    covariance = tie.covariance(1e-6 * np.eye(c.size), size)
    assert np.sqrt(covariance[0, 0]) == pytest.approx(0.06 / 0.05 * 0.5, rel=1e-2)
    assert np.sqrt(covariance[1, 1]) == pytest.approx(1e-3)
