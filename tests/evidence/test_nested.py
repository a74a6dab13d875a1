"""Effects that a fit cannot tell from nothing are refuted, however likely the fit itself came out."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from tests.evidence.linear import candidate
from tests.evidence.test_search import OPTIONS, robot, searched
from workbench.identify.evidence.fit import fit_hypothesis, regress
from workbench.identify.evidence.hypothesis import Prior, log_odds
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
