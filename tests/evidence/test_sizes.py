"""Priors and limits of effect sizes, from the size that one servo in a hundred exceeds."""

import numpy as np
import pytest
from scipy.integrate import quad

from tests.evidence.linear import JOINT, candidate
from workbench.effects.registry import known_effects
from workbench.identify.evidence.hypothesis import Prior, Uncertain, start
from workbench.identify.evidence.options import EvidenceOptions
from workbench.identify.parameters import Candidate
from workbench.robot import puppy_model

KNOWN = known_effects()


def prior_of(name: str, neutral: float) -> tuple[Candidate, Prior]:
    c = Candidate.of(KNOWN[name], ("j",), (neutral,))
    return c, Prior.of(start(()).with_effect(c, np.array([1.0])), EvidenceOptions())


@pytest.mark.parametrize(("name", "neutral", "beyond"), [("backlash", 0.0, 4.0), ("command_delay", 0.0, 0.04)])
def test_one_in_a_hundred_is_beyond_what_the_effect_says(name, neutral, beyond):
    c, prior = prior_of(name, neutral)
    (x,) = c.sizes([beyond])
    assert quad(lambda v: np.exp(prior.log(np.array([v]))), x, np.inf)[0] == pytest.approx(0.01, rel=1e-3)
    assert quad(lambda v: np.exp(prior.log(np.array([v]))), 0.0, np.inf)[0] == pytest.approx(1.0, rel=1e-3)


def test_friction_adds_to_a_constant_or_takes_from_it_as_far_as_that_goes():
    c = Candidate.of(KNOWN["coulomb_friction"], ("j",), (0.0,), lowest=(-0.15,))
    more, less = c.one_way()
    for x, expected in (([2.0], 0.06), ([-1.0], 0.0)):
        assert more.values(x) == pytest.approx([expected])
        assert less.values(x) == pytest.approx([-expected])
    assert [float(b[0]) for b in less.bounds()] == pytest.approx([0.0, 5.0])
    assert less.values([9.0]) == [-0.15]
    assert less.key == more.key
    assert Prior.of(start(()).with_effect(less, np.ones(1)), EvidenceOptions()).one_sided.all()
    assert c.values([-2.0]) == pytest.approx([-0.06])


@pytest.mark.parametrize("nominal", [0.0, 0.001])
def test_a_constant_too_small_to_be_noticed_is_not_taken_away(nominal):
    c = Candidate.of(KNOWN["coulomb_friction"], ("j",), (0.0,), lowest=(-nominal,))
    (more,) = c.one_way()
    assert more.bounds()[0] == [0.0]


def test_load_friction_that_takes_from_the_nominal_one_keeps_its_sign_with_options():
    c = Candidate.of(KNOWN["load_friction"], ("j",), (0.0, 0.0, 20.0, 0.0), lowest=(-0.3, 0.0, 0.5, 0.0))
    less = c.one_way()[1].with_options(("static",))
    assert less.less
    assert less.values([1.0, 1.0, 0.0]) == pytest.approx([-0.15, 0.15, 20.0])
    assert less.values([9.0, -1.0, 0.0]) == pytest.approx([-0.3, 0.0, 20.0])


def test_twelve_degrees_of_play_cost_more_than_where_nobody_says_what_is_usual():
    (_, play), (_, soft) = prior_of("backlash", 0.0), prior_of("joint_compliance", np.inf)
    cost = [p.log(np.array([1.0])) - p.log(np.array([12.0])) for p in (play, soft)]
    assert cost[0] > 8.0 > 3.0 > cost[1]


def test_friction_twice_as_much_one_way_is_as_far_as_half():
    c, _ = prior_of("friction_asymmetry", 1.0)
    assert c.sizes([2.0])[0] == pytest.approx(-c.sizes([0.5])[0])
    assert c.values(c.sizes([3.0]))[0] == pytest.approx(3.0)


def test_no_number_goes_further_than_twice_that_and_a_stiffness_has_no_end():
    model = puppy_model()
    reach = {name: KNOWN[name].reach(None, model, ("flm",)) for name in ("backlash", "friction_asymmetry", "joint_compliance")}
    assert reach["backlash"] == pytest.approx(8.0)
    assert np.exp(reach["friction_asymmetry"]) == pytest.approx(2.5**2)
    assert reach["joint_compliance"] == np.inf


def test_options_and_effects_that_are_zero_are_dropped():
    """Load friction with nothing at rest is load friction; it vanishes only where all that makes it is zero."""
    both, play = candidate("load_friction", ("backdrive", "static")), candidate("backlash")
    h = start((Uncertain(JOINT, "number 0", 0.1),)).with_effect(both, np.array([2.0, 0.0, -1.0, 0.3]))
    h = h.with_effect(play, np.zeros(1))
    less, remain = h.without_zero()
    assert [(c.name, c.options) for c in less.effects] == [("load_friction", ("backdrive",))]
    assert less.theta.tolist() == [0.0, 2.0, 0.3]
    assert remain.tolist() == [True, True, False, False, True, False]
    assert h.at(np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])).without_zero()[0].effects == ()
    only = h.at(np.array([0.0, 0.0, 0.5, 1.0, 0.0, 0.0])).without_zero()[0]
    assert [(c.name, c.options) for c in only.effects] == [("load_friction", ("static",))]
    assert only.without_zero()[1].all()
