"""Effects that a fit cannot tell from nothing are refuted, however likely the fit itself came out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from tests.evidence.linear import Linear, candidate, linear, region
from tests.evidence.test_search import NAMES, OPTIONS, robot, searched, waves
from workbench.identify.evidence.fit import fit_hypothesis, regress
from workbench.identify.evidence.hypothesis import Prior, Uncertain, log_odds, start
from workbench.identify.evidence.nested import improbable_effects
from workbench.identify.evidence.search import lockstep


def refuted(rollouts, names: dict[str, float]):
    """Names of the effects that are refuted at these sizes, with the evidence against each [nats]."""
    after, found, _ = searched(rollouts)
    best = found.best
    h = best.hypothesis.without(lambda c: True)
    for name, size in names.items():
        c = candidate(name)
        h = h.with_effect(c, [size] + [0.0] * (c.size - 1))
    fit = lockstep(after, {0: fit_hypothesis(found.region, OPTIONS, h, best.discrepancy, OPTIONS.iterations)})[0]
    said = lockstep(after, {0: improbable_effects(found.region, OPTIONS, fit)})[0]
    return {c.name: why.behind for c, why in said.items()}


def test_what_is_there_stays_and_what_is_not_goes():
    said = refuted(robot({"load_friction": 2.0}), {"load_friction": 2.0, "backlash": 0.0})
    assert said.keys() == {"backlash"}
    assert said["backlash"] > -log_odds(6, OPTIONS.expected)


class Proportional(Linear):
    """Residuals that are proportional to a friction of nominally 0.16 N m, which is recalibrated by a factor."""

    def left(self, h):
        added = sum(c.values(x)[0] for c, x in h.sizes() if c.name == "coulomb_friction")
        return self.truth - max(0.16 * np.exp(h.numbers[0].sd * h.z[0]) + added, 0.0) * self.does["coulomb_friction"]


def test_less_friction_stays_where_a_recalibration_would_have_to_go_five_times_as_far_as_is_known():
    """By its slope at the fit, a recalibration of 1.8 standard deviations would do instead; it is a factor, and 5 are needed."""
    both = replace(candidate("coulomb_friction"), lowest=(-0.16,)).one_way()
    of = region([*both, *(candidate(n) for n in NAMES[1:])])
    of = replace(of, numbers=(Uncertain("j", "coulomb_friction", 0.5),))
    signal, *_ = waves(0, len(of.likelihood.known), 1)
    noise = np.random.default_rng(1).normal(size=len(signal)) * 2e-3
    for hidden in (0.013, 0.11):
        rollouts = Proportional(**vars(linear(of, hidden * 30 * signal + noise, {"coulomb_friction": 30 * signal})))
        h = start(of.numbers).with_effect(both[1], np.array([(0.16 - hidden) / 0.03]))
        fit = lockstep(rollouts, {0: fit_hypothesis(of, OPTIONS, h, 2e-3, OPTIONS.iterations)})[0]
        said = lockstep(rollouts, {0: improbable_effects(of, OPTIONS, fit)})[0]
        assert [c.name for c in said] == ([] if hidden == 0.013 else ["coulomb_friction"])


def test_nothing_is_refuted_where_all_effects_are_there():
    assert refuted(robot({"load_friction": 2.0, "backlash": 1.5}), {"load_friction": 2.0, "backlash": 1.5}) == {}


def test_the_ratio_is_that_of_the_densities_at_zero():
    """J. Dickey's: that of the posterior, which ends at zero where the size cannot be negative, over that of the prior."""
    after, found, _ = searched(robot({"load_friction": 2.0}))
    h = found.best.hypothesis.without(lambda c: True)
    for name in ("parallel_spring", "backlash"):
        c = candidate(name)
        h = h.with_effect(c, [0.01] + [0.0] * (c.size - 1))
    fit = lockstep(after, {0: fit_hypothesis(found.region, OPTIONS, h, found.best.discrepancy, OPTIONS.iterations)})[0]
    said = lockstep(after, {0: improbable_effects(found.region, OPTIONS, fit)})[0]
    fit = lockstep(after, {0: regress(found.region, OPTIONS, fit)})[0]
    covariance, prior = fit.covariance(found.region, OPTIONS), Prior.of(fit.hypothesis, OPTIONS)
    assert said
    for c, own in zip(fit.hypothesis.effects, fit.hypothesis.slices()):
        made = np.arange(own.start, own.stop)[c.makes]
        x, V = fit.hypothesis.theta[made], covariance[np.ix_(made, made)]
        density = multivariate_normal(x, V).logpdf(np.zeros(len(made)))
        ended = prior.one_sided[made]
        density -= np.sum(norm.logcdf(np.abs(x) / np.sqrt(np.diag(V)))[ended])
        odds = prior.at_center[made].sum() - density + log_odds(6, OPTIONS.expected)
        assert (said[c].behind if c in said else 0.0) == pytest.approx(max(0.0, -odds))
