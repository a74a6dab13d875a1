"""A constant recalibrated and an effect that adds to it: split by the prior, without a change of the robot."""

from dataclasses import fields, replace

import numpy as np
import pytest

from tests.evidence.linear import candidate, linear, region
from tests.evidence.test_nested import Proportional
from tests.evidence.test_search import NAMES, OPTIONS, waves
from tests.servo_rig import rig_model
from workbench.effects.apply import add_possible, physics_of
from workbench.effects.registry import effect_named
from workbench.identify.evidence.fit import fit_hypothesis
from workbench.identify.evidence.hypothesis import ZERO, Prior, split_sums, start
from workbench.identify.evidence.nested import improbable_effects
from workbench.identify.evidence.nuisance import as_mapping, recalibrate, uncertain_numbers
from workbench.identify.evidence.search import lockstep
from workbench.identify.parameters import Candidate
from workbench.robot import ServoConstants

SERVO = ServoConstants(compliance_slope=None, compliance_margin=None, punch=None, proportional_gain=20.0, minimum_duty=0.02,
                       dead_zone=0.3, goal_delay=0.02, command_filter=0.01, derivative_gain=0.05, load_friction=0.2,
                       sd=(("command_filter", 0.003), ("dead_zone", 0.1), ("derivative_gain", 0.02), ("minimum_duty", 0.01)))
ADDED = {"coulomb_friction": 2.0, "viscous_friction": 1.0, "reflected_inertia": 0.5, "minimum_duty": 1.5, "dead_band": 1.0,
         "command_filter": 1.0, "damping_gain": 1.0, "zero_offset": 1.0}


@pytest.mark.parametrize("name", ADDED)
def test_the_robot_stays_and_the_prior_grows(tmp_path, name):
    model = rig_model(tmp_path, SERVO)
    effect = effect_named(name)
    for c in Candidate.of(effect, ("j",), effect.neutral(model), lowest=effect.lowest(model, ("j",))).one_way():
        h = start(uncertain_numbers(model, "j"))
        (k,) = (k for k, n in enumerate(h.numbers) if n.is_changed_by(effect))
        h = h.with_effect(c, np.array([0.3 * ADDED[name]]))
        h = h.at(np.where(np.arange(len(h.theta)) == k, 1.7, h.theta))
        J = np.ones((4, len(h.theta)))
        split, slopes = split_sums(h, J, OPTIONS)
        before, after = (physics_of(add_possible(recalibrate(model, as_mapping(x.numbers, x.z)), x.specs())) for x in (h, split))
        for f in fields(before.law):
            np.testing.assert_allclose(getattr(after.law, f.name), getattr(before.law, f.name), rtol=1e-9, err_msg=f.name)
        np.testing.assert_allclose(after.zero, before.zero, rtol=1e-9)
        prior = Prior.of(h, OPTIONS)
        assert prior.log(split.theta) > prior.log(h.theta) + 0.05
        again, same = split_sums(split, slopes, OPTIONS)
        np.testing.assert_allclose(again.theta, split.theta, atol=0.01)
        np.testing.assert_allclose(same, slopes, rtol=0.01)
        moved = np.flatnonzero(split.theta != h.theta)
        assert list(moved) == [k, len(h.theta) - 1]
        factor = 1.0 if h.numbers[k].name == ZERO else np.exp(h.numbers[k].sd * (split.theta[k] - 1.7))
        np.testing.assert_allclose(slopes[0], np.where(np.arange(len(h.theta)) == k, factor, 1.0))


def test_what_is_taken_away_altogether_is_left_as_it_is(tmp_path):
    """No friction remains, however it is split: more of the effect would change nothing."""
    model = rig_model(tmp_path, SERVO)
    effect = effect_named("coulomb_friction")
    _, less = Candidate.of(effect, ("j",), effect.neutral(model), lowest=effect.lowest(model, ("j",))).one_way()
    h = start(uncertain_numbers(model, "j")).with_effect(less, less.bounds()[1])
    h = h.at(np.where(h.theta == 0, -0.5, h.theta))
    split, _ = split_sums(h, np.ones((1, len(h.theta))), OPTIONS)
    np.testing.assert_array_equal(split.theta, h.theta)


def test_friction_stays_where_the_fit_recalibrated_the_nominal_one_almost_as_far_as_it_may_go():
    """With the nominal friction at 2.9 standard deviations the effect is so small that it seems to be absent; but without it the
    recalibration would need 3.1, more than its limit."""
    c = candidate("coulomb_friction")
    of = region([c, *(candidate(n) for n in NAMES[1:])])
    (number,) = of.numbers
    of = replace(of, numbers=(replace(number, name="coulomb_friction", sd=0.5, nominal=0.16),))
    signal, *_ = waves(0, len(of.likelihood.known), 1)
    noise = np.random.default_rng(1).normal(size=len(signal)) * 2e-3
    hidden = 0.16 * np.exp(0.5 * 3.1)
    rollouts = Proportional(**vars(linear(of, hidden * 30 * signal + noise, {"coulomb_friction": 30 * signal})))
    h = start(of.numbers).with_effect(c, np.array([(hidden - 0.16 * np.exp(0.5 * 2.9)) / 0.03]))
    h = h.at([2.9, h.theta[1]])
    fit = lockstep(rollouts, {0: fit_hypothesis(of, OPTIONS, h, 2e-3, OPTIONS.iterations)})[0]
    assert fit.hypothesis.theta[0] < 2.5
    assert lockstep(rollouts, {0: improbable_effects(of, OPTIONS, fit)})[0] == {}
    left = rollouts.left(fit.hypothesis)
    np.testing.assert_allclose(left, fit.r, atol=1e-9)
