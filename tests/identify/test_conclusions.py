"""Intervals of numbers, in the contract's units."""

from types import SimpleNamespace

import numpy as np
import pytest

from workbench.effects.registry import known_effects
from workbench.effects.schedules import LOOP
from workbench.identify.conclusions import estimates, list_unexplained, verdict_of
from workbench.identify.fitting.fit import Fit
from workbench.identify.options import CONCLUSIONS
from workbench.identify.parameters import Candidate
from workbench.identify.point_mass import PointMass
from workbench.identify.results.findings import Alternative, Change, Finding, Unexplained
from workbench.identify.results.reasons import Dependence
from workbench.identify.selection.explanation import finding, list_rejected
from workbench.identify.selection.model_comparison import NamePosterior, Rival

FRAME = {0: np.ones((1, 1))}
EVERY = np.ones(1, dtype=bool)
SEEN = [SimpleNamespace(joints=("knee",), channels=("knee",), sigma=np.ones(1), uses={"fit": EVERY, "validate": EVERY})]
SD90 = CONCLUSIONS.z90 * CONCLUSIONS.wider
"""Half of an interval, in standard deviations of a fit."""


def test_where_a_mass_is_errs_with_its_moment_and_with_the_mass_together():
    """A moment m = mass * place: its variance at a known mass, and what the mass alone would move it by if they err together."""
    c = PointMass.of(known_effects()["payload"], ("body_link",), (0.0, 0.0, 0.0, 0.0))
    x = np.array([4.0, 4.0, 8.0, -4.0])
    alone = estimates(c, x, np.diag([0.0, 0.04, 0.0, 0.0]))["position"]
    assert alone.value == pytest.approx((0.02, 0.04, -0.02))
    assert alone.high[0] - alone.value[0] == pytest.approx(SD90 * 0.2 / 4 * 0.02, rel=1e-3)
    assert alone.high[1] - alone.value[1] == pytest.approx(CONCLUSIONS.z90 * CONCLUSIONS.least_relative * 0.04, rel=1e-3)
    same_place = 0.25 * np.outer(x, x) / 16
    together = estimates(c, x, same_place)
    assert together["mass"].high - together["mass"].value == pytest.approx(SD90 * 0.5 * 0.05, rel=1e-3)
    assert together["position"].high[0] - 0.02 == pytest.approx(CONCLUSIONS.z90 * CONCLUSIONS.least_relative * 0.02, rel=1e-3)


def test_no_number_is_known_better_than_a_share_of_what_it_differs_from_neutral_by():
    c = Candidate.of(known_effects()["clock_rate"], (), (1.0,))
    told = estimates(c, np.array([1.0]), np.zeros((1, 1)))["ratio"]
    assert told.high - told.value == pytest.approx(CONCLUSIONS.z90 * CONCLUSIONS.least_relative * abs(told.value - 1.0), rel=1e-6)


def test_no_delay_is_known_better_than_models_may_set_out_sooner_or_later():
    c = Candidate.of(known_effects()["command_delay"], ("knee",), (0.0,))
    told = estimates(c, np.array([3.0]), np.array([[1e-6]]))["delay"]
    assert told.high - told.value == pytest.approx(CONCLUSIONS.z90 * LOOP / np.sqrt(3.0), rel=1e-6)
    assert told.value - told.low == pytest.approx(told.high - told.value)


def test_places_that_the_data_cannot_tell_apart_are_named_together_and_other_effects_stay_alternatives():
    def length(link):
        return Candidate.of(known_effects()["link_length"], (link,), (0.0,))

    x = np.array([1.0])
    cost = dict.fromkeys(("fit", "choose", "validate"), 0.0)
    fit = Fit((length("thigh"),), x, np.eye(1), cost, FRAME)
    other = Candidate.of(known_effects()["zero_offset"], ("knee",), (0.0,))
    rivals = [Rival(c, x, behind, p, fit)
              for c, behind, p in ((length("shank"), 10.0, 0.3), (other, 20.0, 0.2), (length("hip"), 90.0, 0.01))]
    standing = NamePosterior(0.45, tuple(rivals))
    told = finding(SEEN, fit, 0, standing, FRAME, FRAME)
    assert told.where == ("thigh", "shank")
    assert told.confidence == pytest.approx(0.75)
    assert [(a.effect, a.where) for a in told.alternatives] == [("zero_offset", ("knee",))]
    lost = {(r.effect, r.where) for r in list_rejected(SEEN, fit, (), [standing], FRAME)}
    assert lost == {("zero_offset", ("knee",)), ("link_length", ("hip",))}


def test_a_family_is_as_sure_as_those_of_its_members_together_that_could_act_there():
    def candidate(name, *where):
        return Candidate.of(known_effects()[name], where, known_effects()[name].neutral(SimpleNamespace()))

    x = np.ones(1)
    fit = Fit((candidate("coulomb_friction", "knee"),), x, np.eye(1), dict.fromkeys(("fit", "choose", "validate"), 0.0), FRAME)
    others = (("load_friction", "knee", 0.3), ("backlash", "knee", 0.1), ("viscous_friction", "hip", 0.05))
    rivals = [Rival(candidate(name, joint), x, 1.0, p, fit) for name, joint, p in others]
    told = finding(SEEN, fit, 0, NamePosterior(0.5, tuple(rivals)), FRAME, FRAME)
    assert told.family is not None
    assert (told.family.name, told.family.confidence) == ("friction", pytest.approx(0.8))


def test_a_name_that_is_less_likely_than_not_explains_nothing():
    def named(confidence, *ties):
        change = Change(1.0, 0.1, "deg")
        return Finding("ground_friction", (), confidence, {}, change, change, ties)

    tie = Alternative("ground_tilt", (), 0.3)
    rest = Unexplained((), 1.0, 0.1, "deg", Dependence("wave", "one"))
    assert verdict_of(False, [], []) == "no_gap"
    assert verdict_of(True, [], [rest]) == "unexplained"
    assert verdict_of(True, [named(0.9)], []) == verdict_of(True, [named(0.4, tie)], []) == "explained"
    assert verdict_of(True, [named(0.9), named(0.4)], []) == verdict_of(True, [named(0.9)], [rest]) == "partly_explained"


@pytest.mark.parametrize(("size", "floor", "left"), [(1.0, 0.0, ()), (1.6, 0.0, ("three",)), (1.6, 1.0, ())],
                         ids=["noise alone", "more than noise", "no more than the fitted model's own floor"])
def test_what_stays_beyond_noise_and_floor_on_unseen_stretches_is_unexplained(worn, size, floor, left):
    """Residuals over sigma of `size` in one joint, white, on the take's frames; in the others as noise makes them."""
    (e,) = worn[1].evaluator.evidence
    residual = np.random.default_rng(0).normal(size=e.recorded.shape)
    residual[:, e.channels.index("three")] *= size
    floors = {0: np.where(np.array(e.channels) == "three", floor, 0.0)}
    assert tuple(j for u in list_unexplained([e], {0: residual}, floors) for j in u.where) == left


@pytest.mark.parametrize("goes_with", ["angle", "speed", None])
def test_what_is_left_says_which_signal_it_goes_with(worn, goes_with):
    (e,) = worn[1].evaluator.evidence
    random = np.random.default_rng(1)
    angle = e.take.recorded.q[:, e.take.recorded.column("three")]
    signal = {"angle": angle, "speed": np.gradient(angle, e.take.recorded.time), None: random.normal(size=len(angle))}[goes_with]
    residual = random.normal(size=e.recorded.shape)
    residual[:, e.channels.index("three")] += 4.0 * (signal - np.nanmean(signal)) / np.nanstd(signal)
    (said,) = list_unexplained([e], {0: residual}, {})
    assert said.where == ("three",)
    assert said.description.signal == goes_with
