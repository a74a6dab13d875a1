"""A joint's zero that the search recalibrated and found as well: the recordings show the sum alone, and so do the results."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.evidence.linear import JOINT, candidate, linear, region
from tests.servo_rig import rig_model
from workbench.identify.conclusions import estimates
from workbench.identify.evidence.explanation import Explanation
from workbench.identify.evidence.fit import Fitted
from workbench.identify.evidence.hypothesis import ZERO, Uncertain, start
from workbench.identify.evidence.nuisance import with_whole_zeros
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.evidence.posterior import posterior_of
from workbench.identify.evidence.recalibration import as_stated
from workbench.robot import EffectSpec, ServoConstants

OPTIONS = EvidenceOptions()
NUMBERS = (Uncertain(JOINT, "coulomb_friction", 0.2), Uncertain(JOINT, ZERO, math.radians(1.15)))
OFFSET, PLAY = candidate("zero_offset"), candidate("backlash")
RECALIBRATED, FOUND = 2.0, 4.0
"""Of a zero of 6 deg [deg]."""


@pytest.fixture(name="searched")
def _searched():
    """A region, and a fit in which a zero is recalibrated and found; the log shows their sum to a few hundredths of a degree."""
    of = replace(region([OFFSET, PLAY]), numbers=NUMBERS)
    h = start(NUMBERS).with_effect(PLAY, np.array([0.5])).with_effect(OFFSET, OFFSET.sizes([FOUND]))
    theta = h.theta.copy()
    theta[:2] = 0.3, RECALIBRATED / 1.15
    n = sum(p.size for p in of.parts)
    shift, friction, play = np.ones(n), np.sin(np.arange(n)), np.cos(np.arange(n))
    J = np.column_stack([1e-3 * friction, NUMBERS[1].sd * shift, 1e-3 * play, math.radians(OFFSET.typical[0]) * shift])
    return of, Fitted(h.at(theta), np.zeros(n), J, 1e-3, 0.0, 0.0)


def _explanation(model, of, fit):
    rollouts = replace(linear(of, fit.r, {}), nominal=model)
    nothing = SimpleNamespace(together=SimpleNamespace(shared=start(()), covariance=np.zeros((0, 0))))
    return Explanation(nominal=model, looked_at=(), missed=(), drifts=(), stopped=False, rollouts=rollouts, found=(),
                       posteriors=(posterior_of([fit], OPTIONS),), robot=nothing, refuted=(), options=OPTIONS, of_tie=())


def test_a_found_zero_is_stated_with_what_was_recalibrated_of_it(searched):
    of, fit = searched
    h, covariance = as_stated(fit, of, OPTIONS)
    own = h.slices()[1]
    (angle,) = estimates(OFFSET, h.theta[own], covariance[own, own]).values()
    assert angle.value == pytest.approx(RECALIBRATED + FOUND)
    assert angle.high - angle.low < 1.0, "alone it is known to the standard deviation of the recalibration"
    assert np.degrees(h.theta[1] * NUMBERS[1].sd) == pytest.approx(RECALIBRATED + FOUND)
    assert covariance[1, 1] * 1.15**2 == pytest.approx(covariance[own, own].item() * OFFSET.typical[0]**2)
    others = [0, 2]
    np.testing.assert_array_equal(h.theta[others], fit.hypothesis.theta[others])
    np.testing.assert_allclose(covariance[np.ix_(others, others)], fit.covariance(of, OPTIONS)[np.ix_(others, others)])


def test_the_model_and_its_posterior_have_one_zero(tmp_path, searched):
    of, fit = searched
    found = _explanation(rig_model(tmp_path, ServoConstants()), of, fit)
    zero, play = found.model.effects
    assert (zero.effect, play.effect) == ("zero_offset", "backlash")
    assert zero.parameters["angle"] == pytest.approx(RECALIBRATED + FOUND)
    posterior = found.posterior(())
    assert posterior.names == ("zero_offset(j).angle", "backlash(j).gap")
    assert posterior.mean[0] == pytest.approx(RECALIBRATED + FOUND)
    assert math.sqrt(posterior.covariance[0, 0]) < 0.3
    assert [r.number for r in found.recalibrated] == ["coulomb_friction"]


def test_zeros_of_other_joints_and_those_beyond_the_range_stay_apart(tmp_path):
    def turned(joint, angle):
        return EffectSpec("zero_offset", (joint,), {"angle": angle})

    play = EffectSpec("backlash", ("j",), {"gap": 1.0})
    model = rig_model(tmp_path, ServoConstants())
    whole = with_whole_zeros(model.with_effects((turned("j", 1.0), play, turned("j", -4.0), turned("k", 2.0), turned("j", 0.5))))
    assert whole.effects == (turned("j", -2.5), play, turned("k", 2.0))
    far = model.with_effects((turned("j", 44.0), turned("j", 3.0)))
    assert with_whole_zeros(far) is far
