"""Gravity over torque: one number, with the size of each effect that would explain it alone."""

import json
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.evidence.linear import JOINT, Linear, candidate, region
from workbench.identify.evidence.fit import fit_hypothesis, regress
from workbench.identify.evidence.hypothesis import Uncertain, start
from workbench.identify.evidence.options import EvidenceOptions, SinceThen
from workbench.identify.evidence.posterior import posterior_of
from workbench.identify.evidence.search import lockstep
from workbench.identify.evidence.tied_names import TieFits, fits_of_tie, gravity_over_torque, ratio_of, shared_by_tie
from workbench.identify.results.findings import Alternative, Change, Estimate, Finding
from workbench.identify.results.servo_law import GravityOverTorque, TiedName

OPTIONS = EvidenceOptions()
SHIFT = 0.04
"""Change of the logarithm of torque that one typical size of either effect equals."""


@dataclass(frozen=True)
class Scaled(Linear):
    """A number does as much as it changes, however well it is known."""

    def left(self, h):
        scaled = replace(h, theta=np.concatenate([[n.sd * z for n, z in zip(h.numbers, h.z)], h.theta[len(h.numbers):]]))
        return super().left(scaled)


def found(log_ratio, sd, options=OPTIONS, loaded=1.0):
    """A rig with this ratio of gravity to torque, whose torque is known to sd: its region, its plain fit, and fits of the tie.
    loaded: share of the effects' response in the second half, where a known weight hangs and torques hold more."""
    names = [candidate(name) for name in ("ground_tilt", "parallel_spring", "backlash")]
    here = replace(region(names), numbers=(Uncertain(JOINT, "torque_at_full_duty", sd),))
    rng = np.random.default_rng(3)
    torque, play = rng.normal(size=(2, 1600)) * 0.1
    does = {"torque_at_full_duty": torque, "backlash.gap": play}
    gravity = np.where(np.arange(1600) < 800, 1.0, loaded) * torque
    does |= {f"{c.name}.{c.parameters[0].name}": -SHIFT * gravity for c in names[:2]}
    truth = -log_ratio * torque + 1e-3 * rng.normal(size=1600)
    rig = Scaled(None, None, (here,), (start(here.numbers),), None, None, truth=truth, does=does)
    fit = lockstep(rig, {0: fit_hypothesis(here, options, start(here.numbers), 0.1, 2 * options.iterations)})[0]
    fits = lockstep(rig, {0: fits_of_tie(here, options, fit)})[0]
    if fits is not None:
        again = [lockstep(rig, {0: regress(here, options, g)})[0] for g in (fits.torque, *fits.names)]
        fits = TieFits(here, again[0], tuple(again[1:]))
    return here, fit, fits


def test_a_motor_stronger_than_its_data_sheet_is_reported_as_a_ratio_with_all_names():
    here, fit, fits = found(math.log(0.6), 0.5)
    ratio = ratio_of(here, OPTIONS, fit)
    assert math.exp(ratio.log) == pytest.approx(0.6, rel=0.01)
    tied = gravity_over_torque(here, OPTIONS, posterior_of([fit], OPTIONS), fits)
    assert tied.confidence == 0.0
    assert "ground_tilt" in {n.effect for n in tied.names}
    sizes = {g.hypothesis.effects[0].name: g.hypothesis.sizes()[0][1][0] for g in fits.names}
    assert sizes["ground_tilt"] == pytest.approx(math.log(0.6) / SHIFT, rel=0.3)
    said = json.dumps(tied.to_json())
    assert "times that of the files" in said
    assert "`load:`" in said
    assert "`--model`" in said


def test_another_option_of_an_effect_that_stays_is_no_name_of_the_tie():
    """Load friction could still get its part at rest."""
    names = [candidate("ground_tilt"), candidate("load_friction")]
    here = replace(region(names), numbers=(Uncertain(JOINT, "torque_at_full_duty", 0.5),))
    rng = np.random.default_rng(3)
    torque, rubs = rng.normal(size=(2, 1600)) * 0.1
    does = {"torque_at_full_duty": torque, "load_friction.coefficient": rubs, "load_friction.static": 0.5 * rubs,
            "ground_tilt.forward": -SHIFT * torque}
    truth = -math.log(0.6) * torque + rubs + 1e-3 * rng.normal(size=1600)
    rig = Scaled(None, None, (here,), (start(here.numbers),), None, None, truth=truth, does=does)
    h = start(here.numbers).with_effect(names[1], np.ones(1))
    fit = lockstep(rig, {0: fit_hypothesis(here, OPTIONS, h, 0.1, 2 * OPTIONS.iterations)})[0]
    fits = lockstep(rig, {0: fits_of_tie(here, OPTIONS, fit)})[0]
    assert {g.hypothesis.effects[-1].name for g in fits.names} == {"ground_tilt"}


def test_the_last_fit_may_be_to_more_of_the_takes_than_the_fits_of_the_tie():
    """Of sessions over 100 s the search takes the beginnings, and the last fit 200 s."""
    here, fit, fits = found(math.log(0.6), 0.5)
    longer = replace(region([], n=800), numbers=here.numbers, candidates=here.candidates)
    twice = replace(fit, r=np.tile(fit.r, 2), J=np.tile(fit.J, (2, 1)))
    short = gravity_over_torque(here, OPTIONS, posterior_of([fit], OPTIONS), fits)
    tied = gravity_over_torque(longer, OPTIONS, posterior_of([twice], OPTIONS), fits)
    assert tied.names == short.names
    assert tied.ratio.value == short.ratio.value
    assert tied.ratio.high - tied.ratio.low < short.ratio.high - short.ratio.low


def test_variation_between_days_is_not_reported():
    assert found(0.05, 0.5)[2] is None


def test_a_known_weight_in_some_takes_leaves_torque_as_the_only_cause():
    here, fit, fits = found(math.log(0.6), 0.5, loaded=0.5)
    tied = gravity_over_torque(here, OPTIONS, posterior_of([fit], OPTIONS), fits, weighed=True)
    assert tied.torque_behind == 0.0
    assert min(n.behind for n in tied.names) > OPTIONS.occam
    assert tied.competitive == ()
    assert "leave only one possible cause: all torques of the servo multiplied by 1.66" in tied.in_words()
    assert "`load:`" not in tied.in_words()


def test_beside_an_earlier_diagnosis_the_change_is_the_ratio():
    since = EvidenceOptions(drift=SinceThen())
    here, fit, fits = found(math.log(1.3), 0.06, since)
    best = max(fits.names, key=lambda g: g.log_posterior)
    said = gravity_over_torque(here, since, posterior_of([fit, *fits.names], since), fits)
    assert said.ratio.value == pytest.approx(1.3, rel=0.02)
    assert said.ratio.low < 1.3 < said.ratio.high
    assert said.confidence > 0.8
    assert best.log_posterior > fit.log_posterior
    assert "--model" not in said.in_words()


def test_names_that_fits_do_not_separate_share_the_ties_probability():
    def finding(effect):
        change = Change(1.0, 0.5, "deg")
        return Finding(effect, (JOINT,), 0.8, {}, change, change)

    def named(effect, behind):
        return TiedName(effect, (JOINT,), {}, "", behind)

    ratio = Estimate(1.3, 1.2, 1.4, "1")
    names = (named("parallel_spring", 0.0), named("payload", 3.0), named("com_shift", 9.0))
    told = GravityOverTorque((JOINT,), ratio, 0.96, names, True, OPTIONS.occam)
    shared = shared_by_tie(finding("parallel_spring"), told)
    assert shared.confidence == pytest.approx(0.48)
    assert shared.alternatives == (Alternative("payload", (JOINT,), 0.48),)
    assert shared.to_json()["confidence"] == pytest.approx(0.48)
    assert shared.of_tie == pytest.approx(0.96)
    assert shared.likely
    for alone in (finding("backlash"), finding("com_shift")):
        assert shared_by_tie(alone, told) == alone
    assert shared_by_tie(finding("payload"), None) == finding("payload")


def test_a_name_far_behind_is_in_the_table_and_not_in_the_sentence():
    names = (TiedName("payload", ("arm",), {}, "arm carries 200 g more.", 0.0),
             TiedName("parallel_spring", (JOINT,), {}, "A spring pulls.", 40.0))
    tie = GravityOverTorque((JOINT,), Estimate(1.3, 1.2, 1.4, "1"), 0.9, names, False, OPTIONS.occam)
    assert "arm carries 200 g more" in tie.in_words()
    assert "spring" not in tie.in_words()
    assert [n["effect"] for n in tie.to_json()["names"]] == ["payload", "parallel_spring"]


def turned_by(names, alike):
    """The tie of a rig on which gravity is turned; the first of `names` explains it. alike: names with identical responses."""
    pool = [candidate(name) for name in names]
    here = replace(region(pool), numbers=(Uncertain(JOINT, "torque_at_full_duty", 0.06),))
    torque, turned, other = np.random.default_rng(3).normal(size=(3, 1600)) * 0.1
    does = {"torque_at_full_duty": torque} | {f"{c.name}.{c.parameters[0].name}": SHIFT * (turned if c.name in alike else other)
                                              for c in pool}
    rig = Scaled(None, None, (here,), (start(here.numbers),), None, None, truth=4.0 * SHIFT * turned, does=does)
    plain = start(here.numbers)
    bare = lockstep(rig, {0: fit_hypothesis(here, OPTIONS, plain, 0.1, 9)})[0]
    assert lockstep(rig, {0: fits_of_tie(here, OPTIONS, bare)})[0] is None
    fit = lockstep(rig, {0: fit_hypothesis(here, OPTIONS, plain.with_effect(pool[0], np.ones(pool[0].size)), 0.1, 9)})[0]
    ties = lockstep(rig, {0: fits_of_tie(here, OPTIONS, fit)})[0]
    return gravity_over_torque(here, OPTIONS, posterior_of([fit], OPTIONS), ties)


@pytest.mark.parametrize("names", [("ground_tilt", "parallel_spring"), ("ground_tilt", "zero_offset"),
                                   ("zero_offset", "ground_tilt")])
def test_names_that_turn_gravity_and_leave_its_size_share_their_probability(names):
    told = turned_by(names, alike=names)
    assert {n.effect for n in told.competitive} == set(names)
    assert told.confidence > 0.9
    assert not told.may_be_torque
    assert "while the ratio of gravity to torque is 1.00" in told.change


def test_a_turned_servo_that_is_told_from_a_tilt_is_no_tie():
    assert turned_by(("zero_offset", "ground_tilt"), alike=("zero_offset",)) is None
    assert turned_by(("ground_tilt", "zero_offset"), alike=("ground_tilt",)).competitive[0].effect == "ground_tilt"


@dataclass(frozen=True)
class Stuck(Scaled):
    """Far from the nominal law, the rig with an effect answers nothing."""

    def left(self, h):
        return self.truth if h.effects and np.any(np.abs(h.z) > 1.0) else super().left(h)


def test_a_law_that_was_distorted_for_want_of_an_effect_is_not_the_only_start():
    pool = [candidate(name) for name in ("ground_tilt", "zero_offset")]
    here = replace(region(pool), numbers=(Uncertain(JOINT, "torque_at_full_duty", 0.06),))
    turned = np.random.default_rng(3).normal(size=1600) * 0.1
    does = {"torque_at_full_duty": 0.5 * turned} | {f"{c.name}.{c.parameters[0].name}": SHIFT * turned for c in pool}
    rig = Stuck(None, None, (here,), (start(here.numbers),), None, None, truth=4.0 * SHIFT * turned, does=does)
    plain = start(here.numbers)
    bare = lockstep(rig, {0: fit_hypothesis(here, OPTIONS, plain, 0.1, 9)})[0]
    assert bare.hypothesis.z[0] > 2.0
    fit = lockstep(rig, {0: fit_hypothesis(here, OPTIONS, plain.with_effect(pool[0], np.ones(pool[0].size)), 0.1, 9)})[0]
    ties = lockstep(rig, {0: fits_of_tie(here, OPTIONS, fit)})[0]
    assert {g.hypothesis.effects[0].name for g in ties.names} == {"ground_tilt", "zero_offset"}
    assert max(g.discrepancy for g in ties.names) < 0.1 * bare.discrepancy


def test_a_name_that_was_found_has_the_size_of_its_finding():
    here, _, fits = found(math.log(1.3), 0.06, EvidenceOptions(drift=SinceThen()))
    g = next(g for g in fits.names if g.hypothesis.effects[0].name == "parallel_spring")
    longer = replace(g, hypothesis=g.hypothesis.at(1.1 * g.hypothesis.theta))
    for best in (g, longer):
        told = gravity_over_torque(here, OPTIONS, posterior_of([best], OPTIONS), fits)
        name = next(n for n in told.names if n.effect == "parallel_spring")
        (size,) = best.hypothesis.sizes()[0][1]
        assert name.parameters["stiffness"].value == pytest.approx(best.hypothesis.effects[0].values([size])[0])
