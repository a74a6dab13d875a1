"""Whether enough is left for another effect, and whether an effect brings enough."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from tests.identify.small import fit_of
from workbench.effects.registry import known_effects
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import Candidate
from workbench.identify.proposals import candidates
from workbench.identify.selection import acceptance
from workbench.identify.selection.options import ACCEPTANCE
from workbench.identify.selection.record import CandidateFit, SelectionStep, accepted_effects, before_rough


def leaving(worn, **sizes):
    """A fit that leaves these joints of the arm so far off, in sigma, and all others at half."""
    _, search, nominal = worn
    left = 0.5 * np.ones_like(nominal.residuals[0])
    for joint, size in sizes.items():
        left[:, search.evaluator.evidence[0].channels.index(joint)] = size
    return replace(nominal, residuals={0: left})


@pytest.mark.parametrize("walks", [False, True])
def test_what_earlier_effects_may_err_by_counts_where_they_act_and_hides_nothing_elsewhere(worn, monkeypatch, walks):
    session, whole, nominal = worn
    monkeypatch.setattr(whole.evaluator, "any_floating", lambda takes: walks)
    search = Search(whole.evaluator, session.model)
    taken = next(c for c in candidates(session.model, whole.evaluator.evidence) if c.key == ("coulomb_friction", ("three",)))
    names = whole.evaluator.evidence[0].channels
    n = names.index("three")
    residual = nominal.residuals[0].copy()
    residual[:, n] *= 30
    before = replace(nominal, residuals={0: residual})
    search = search.with_settled(replace(search.evaluate([(taken, np.array([2.6]))]), residuals=nominal.residuals))
    first = SelectionStep(before, (), (CandidateFit(taken, np.array([2.6]), {"fit": 1e6, "choose": 1e6}, "three"),))
    tilt = Candidate.of(known_effects()["ground_tilt"], (), (0.0, 0.0))

    def trial(channel):
        gain = np.where(np.arange(len(names)) == names.index(channel), 2000.0, 0.0)
        return CandidateFit(tilt, np.ones(2), {"fit": 4000.0, "choose": 2000.0}, None, closed=0.9, by_channel=gain)

    assert acceptance.is_acceptable(search, trial("two"), (0,), [first], search.settled)
    assert not acceptance.is_acceptable(search, trial("three"), (0,), [first], search.settled)


def test_on_the_ground_a_strong_effect_hides_nothing_in_channels_that_it_did_not_change(worn, monkeypatch):
    """A stop that floating-base takes identified brought a million in its own joint: another effect is asked for hundredths of
    that there alone."""
    session, whole, nominal = worn
    monkeypatch.setattr(whole.evaluator, "any_floating", lambda takes: True)
    search = Search(whole.evaluator, session.model)
    stop = next(c for c in candidates(session.model, whole.evaluator.evidence) if c.key == ("coulomb_friction", ("three",)))
    names = whole.evaluator.evidence[0].channels
    residual = nominal.residuals[0].copy()
    residual[:, names.index("three")] *= 30
    first = SelectionStep(
        replace(nominal, residuals={0: residual}), (), (CandidateFit(stop, np.ones(1), {"fit": 2e6, "choose": 1e6}, None),)
    )
    tilt = Candidate.of(known_effects()["ground_tilt"], (), (0.0, 0.0))

    def trial(channel):
        gain = np.where(np.arange(len(names)) == names.index(channel), 2000.0, 0.0)
        return CandidateFit(tilt, np.ones(2), {"fit": 4000.0, "choose": 2000.0}, None, closed=0.9, by_channel=gain)

    assert acceptance.is_acceptable(search, trial("two"), (0,), [first], nominal)
    assert not acceptance.is_acceptable(search, trial("three"), (0,), [first], nominal)


def test_with_the_base_held_what_is_left_in_one_joint_is_not_too_little_beside_what_another_had(worn):
    session, whole, _ = worn
    search = Search(whole.evaluator, session.model)
    fade = Candidate.of(known_effects()["thermal_fade"], (), (0.0,))
    fit = partial(leaving, worn)
    first = SelectionStep(fit(three=100.0), (), (CandidateFit(fade, np.ones(1), {"fit": 1e7, "choose": 1e7}, None),))
    assert acceptance.too_little_left(search, fit(three=10.0), (0,), [first])
    assert not acceptance.too_little_left(search, fit(three=40.0), (0,), [first])
    assert not acceptance.too_little_left(search, fit(two=10.0), (0,), [first])


@pytest.mark.parametrize(("left", "given", "asked"), [
    ({"three": 8.0}, False, {"three"}), ({"three": 8.0}, True, set()), ({"three": 8.0, "two": 4.0}, False, set()),
    ({"three": 4.0}, False, set())])
def test_of_what_all_joints_show_hundredths_may_be_left_in_all_but_not_in_one_alone(worn, left, given, asked):
    """Different speeds of every servo hide the compliance of one servo's gear."""
    session, whole, _ = worn
    search = Search(whole.evaluator, session.model)
    own = next(c for c in candidates(session.model, whole.evaluator.evidence) if c.key == ("backlash", ("three",)))
    now = replace(leaving(worn, **left), effects=(own,) if given else ())
    assert set(acceptance.remaining(search, now, leaving(worn, one=60.0, two=60.0, three=100.0), (0,))) == asked


def test_on_the_ground_a_joint_is_not_too_little_beside_what_fixed_base_takes_identified_of_others(worn, monkeypatch):
    session, whole, nominal = worn
    search = Search(whole.evaluator, session.model)
    fade = Candidate.of(known_effects()["thermal_fade"], (), (0.0,))
    fit = partial(leaving, worn)
    first = SelectionStep(fit(three=100.0, two=15.0), (), (CandidateFit(fade, np.ones(1), {"fit": 1e6, "choose": 1e6}, None),))
    search = search.with_settled(replace(search.evaluate([(fade, np.ones(1))]), residuals=nominal.residuals))
    monkeypatch.setattr(whole.evaluator, "any_floating", lambda takes: True)
    assert not acceptance.too_little_left(search, fit(two=13.0), (0,), [first])
    assert acceptance.too_little_left(search, fit(three=13.0), (0,), [first])
    search = search.with_settled(None)
    assert acceptance.too_little_left(search, fit(two=13.0), (0,), [first])


@pytest.mark.parametrize(("name", "left", "share"), [
    ("backlash", {}, ACCEPTANCE.least_closed), ("backlash", {"three": 2.0}, ACCEPTANCE.least_closed),
    ("backlash", {"three": 30.0}, ACCEPTANCE.last_closed), ("dead_band", {"three": 2.0}, ACCEPTANCE.least_closed),
    ("dead_band", {"three": 30.0}, ACCEPTANCE.last_closed)])
def test_beside_a_joint_that_no_name_fits_an_effect_on_the_ground_has_to_be_half(worn, name, left, share):
    session, whole, _ = worn
    search = Search(whole.evaluator, session.model)
    given = next(c for c in candidates(session.model, whole.evaluator.evidence) if c.key == (name, ("three",)))
    assert acceptance.least_closed(search, leaving(worn, three=40.0), replace(leaving(worn, **left), effects=(given,))) == share


def test_what_is_well_hides_no_gap_and_closes_none(worn):
    evaluator = worn[1].evaluator
    e = evaluator.evidence[0]
    quiet = 0.5 * np.ones_like(worn[2].residuals[0])
    ill, better = quiet.copy(), quiet.copy()
    ill[:, e.channels.index("two")] = 3.0
    better[:, e.channels.index("two")] = 2.0
    assert evaluator.beyond({0: quiet}, "choose", {0: quiet}, np.zeros(quiet.shape[1]), False) == 0
    assert evaluator.share_closed({0: ill}, {0: quiet}) == 1
    assert 0.4 < evaluator.share_closed({0: ill}, {0: better}) < 0.8
    assert evaluator.share_closed({0: ill}, {0: better}, "one") == 0
    assert evaluator.share_closed({0: quiet}, {0: ill}) == 0


def test_what_fixed_base_takes_identified_is_judged_on_them_alone(monkeypatch):
    monkeypatch.setattr(acceptance, "standing_out", lambda *_: set())
    c = Candidate.of(known_effects()["timing_drift"], (), (0.0,))
    fit = fit_of((), {0: np.ones(1), 1: np.ones(1)})
    for settled, looked_at in ((True, [0]), (False, [0, 1])):
        search = SimpleNamespace(fixed_base=(0,), fitted=(0, 1), is_settled=lambda _, s=settled: s, evaluator=SimpleNamespace(
            share_closed=lambda before, after, joint, takes=looked_at: 1.0 if list(before) == list(after) == takes else 0.0))
        r = SelectionStep(fit, (), ())
        assert acceptance.explained_at_the_end(search, r, CandidateFit(c, np.ones(1), {}, None), fit) == 1.0


def test_what_floating_base_takes_identify_of_a_joint_is_judged_by_its_own_gap_and_by_all_that_is_not_others(monkeypatch):
    monkeypatch.setattr(acceptance, "standing_out", lambda *_: set())

    def of(name, joint):
        return Candidate.of(known_effects()[name], (joint,), (0.0,) * len(known_effects()[name].parameters))

    own_effect, other = of("coulomb_friction", "two"), of("backlash", "three")
    fit = fit_of((own_effect, other), {0: np.ones(1)})
    trial = CandidateFit(own_effect, np.ones(1), {}, None)
    for own, elsewhere, share in ((1.0, 0.6, 0.8), (0.0, 0.6, 0.6), (0.2, 0.6, 0.6)):  # a zero shows in other joints alone
        shares = {("two", ()): own, (None, ()): 0.2, (None, ("three",)): elsewhere}
        evaluator = SimpleNamespace(
            share_closed=lambda before, after, joint=None, without=(), of=shares: of[joint, tuple(without)]
        )
        search = SimpleNamespace(fixed_base=(), fitted=(0,), is_settled=lambda _: False, evaluator=evaluator)
        assert acceptance.explained_at_the_end(search, SelectionStep(fit, (), ()), trial, fit) == pytest.approx(share)


def test_what_cameras_and_clocks_explain_hides_no_hundredths_of_physics():
    def accepted(name, *where):
        return (CandidateFit(Candidate.of(known_effects()[name], where, (0.0,)), np.ones(1), {}, None),)

    clock, frame, sag, now = accepted("clock_rate"), accepted("marker_frame", "A"), accepted("supply_sag"), fit_of()
    rounds = [SelectionStep("nominal", (), clock), SelectionStep("nominal", (), frame)]
    assert before_rough(rounds, now) is now
    assert before_rough([*rounds, SelectionStep("seen rightly", (), sag)], now) == "seen rightly"
    assert accepted_effects([*rounds, SelectionStep("seen rightly", (), sag)]) == [*sag]


@pytest.mark.parametrize(("walks", "brings", "told"), [(True, 100.0, True), (True, 900.0, False), (False, 100.0, False)])
def test_what_fine_steps_do_not_miss_is_idle_where_floating_base_takes_identified_it(worn, monkeypatch, walks, brings, told):
    session, whole, _ = worn
    search = Search(whole.evaluator, session.model)
    load = next(c for c in candidates(session.model, whole.evaluator.evidence) if c.name == "payload")
    friction = Candidate.of(known_effects()["coulomb_friction"], ("three",), (0.06,))
    fit = replace(search.evaluate([(load, np.ones(load.size)), (friction, np.ones(1))]), cost={"choose": 1e4})
    asked_without = []

    def finely(fit, takes, *points):
        asked_without.extend(fit.sizes(x) for x in points)
        return [replace(fit, cost={"choose": 1e4 + brings}) for _ in points]

    monkeypatch.setattr(search, "floating_base", lambda takes: takes if walks else ())
    monkeypatch.setattr(search, "is_settled", lambda c: c is friction)
    monkeypatch.setattr(search, "finely", finely)
    assert acceptance.idle(search, fit) == ([load] if told else [])
    assert [[x.any() for _, x in sizes] for sizes in asked_without] == ([[False, True]] if walks else [])
