"""Rivals in each other's place: the better one takes it, whoever was taken first."""

from dataclasses import replace

import numpy as np
import pytest

from tests.gap_worn import HIDDEN, NOMINAL
from tests.identify.small import candidate, fit_of, leaving, search_on
from workbench.effects.registry import known_effects
from workbench.identify.fitting.doubts import downward_pulls
from workbench.identify.options import FIT
from workbench.identify.parameters import Candidate
from workbench.identify.point_mass import PointMass
from workbench.identify.proposals import candidates
from workbench.identify.selection import calibration
from workbench.identify.selection.calibration import calibrate
from workbench.identify.selection.model_comparison import NamePosterior, Rival, compare_models, replace_effect, rivals_near
from workbench.identify.selection.odds import (
    better_by_both,
    better_on_fixed_base,
    dispersion,
    is_equivalent,
    is_outpriced,
    misfit,
    numbers_identified,
)
from workbench.identify.selection.options import ODDS, SCHEDULING
from workbench.identify.selection.record import CandidateFit, SelectionResult, SelectionStep
from workbench.identify.selection.screening import fit_groups


def test_a_rival_that_does_better_takes_the_place_and_the_other_stays_beside_it_as_rival(worn):
    session, search, _ = worn
    nominal = search.evaluate([])
    pool = [c for c in candidates(session.model, search.evaluator.evidence)
            if c.key in {("coulomb_friction", ("three",)), ("viscous_friction", ("three",))}]
    trials = [t for c in pool for t in fit_groups(search, nominal, [[c]], {0: (0,)}, lambda share: None)]
    trials.sort(key=lambda t: -t.gain["choose"])
    assert [t.candidate.name for t in trials] == ["coulomb_friction", "viscous_friction"]
    wrong = trials[1]
    first = search.refit(search.evaluate([(wrong.candidate, wrong.x)]), (0,), 1)
    chosen = SelectionResult(search, first, (SelectionStep(nominal, tuple(trials), (wrong,)),))
    _, fit, posteriors = compare_models(search, chosen, lambda what, share: None)
    assert [str(c) for c in fit.effects] == ["coulomb_friction(three)"]
    assert NOMINAL + fit.model(session.model).effects[0].parameters["torque"] == pytest.approx(HIDDEN, rel=0.06)
    assert fit.cost["choose"] < first.cost["choose"]
    assert posteriors[0].probability > 0.5
    assert [r.candidate.name for r in posteriors[0].rivals] == ["viscous_friction"]


def test_what_leaves_much_at_its_place_is_less_sure(worn):
    session, search, _ = worn
    friction = next(c for c in candidates(session.model, search.evaluator.evidence) if c.key == ("coulomb_friction", ("three",)))
    right = search.refit(search.evaluate([(friction, np.array([1.0]))]), (0,), 3)
    far = search.evaluate([(friction, 3.0 * right.x)])
    posteriors = [NamePosterior(0.9, (Rival(friction, right.x, 10.0, 0.08),))]
    floors = {0: np.zeros(len(search.evaluator.evidence[0].channels))}
    assert calibrate(search, right, posteriors, floors) == posteriors
    (less,) = calibrate(search, far, posteriors, floors)
    assert less.probability < 0.5
    assert less.rivals[0].probability == pytest.approx(0.08 / 0.9 * less.probability)
    assert calibrate(search, far, posteriors, {0: 100 + floors[0]}) == posteriors  # all below the fit's own floor


@pytest.mark.parametrize(("ill", "sure"), [(("one",), 0.9), (("one", "three"), 0.36)])
def test_one_joint_may_err_for_itself_beside_what_is_right_everywhere(worn, ill, sure):
    _, search, _ = worn
    fade = Candidate.of(known_effects()["thermal_fade"], (), (0.0,))
    fit = replace(search.evaluate([(fade, np.array([1.0]))]), covariance=np.full((1, 1), np.inf))
    e = search.evaluator.evidence[0]
    residual = np.zeros_like(fit.residuals[0])
    residual[:, [e.channels.index(j) for j in ill]] = 4.0
    standing = calibrate(
        search, replace(fit, residuals={0: residual}), [NamePosterior(0.9, ())], {0: np.zeros(len(e.channels))}
    )[0]
    assert standing.probability == pytest.approx(sure)


def test_what_a_joint_lacks_is_for_its_own_effect_to_answer(worn, monkeypatch):
    _, search, _ = worn
    monkeypatch.setattr(calibration, "SCHEDULING", replace(SCHEDULING, few=3))  # none of three may err for itself
    sag = Candidate.of(known_effects()["supply_sag"], (), (0.0,))
    stiff = Candidate.of(known_effects()["coulomb_friction"], ("one",), (NOMINAL,))
    fit = replace(search.evaluate([(sag, np.ones(1)), (stiff, np.ones(1))]), covariance=np.full((2, 2), np.inf))
    e = search.evaluator.evidence[0]
    residual = np.zeros_like(fit.residuals[0])
    residual[:, e.channels.index("one")] = 7.0
    told = calibrate(search, replace(fit, residuals={0: residual}), [NamePosterior(0.9, ())] * 2, {0: np.zeros(len(e.channels))})
    assert [t.probability for t in told] == pytest.approx([0.9, 0.18])


@pytest.mark.parametrize(("friction", "sure"), [(1.12, 0.45), (0.88, 0.45), (0.7, 0.9), (1.3, 0.9)])
def test_a_floor_that_is_nearly_the_models_may_be_what_engines_make_of_contact(worn, friction, sure):
    _, search, _ = worn
    floor = Candidate.of(known_effects()["ground_friction"], (), (1.0,))
    x = np.array([(friction - 1.0) / (floor.typical[0] - 1.0)])
    fit = replace(search.evaluate([]), effects=(floor,), x=x, covariance=np.full((1, 1), np.inf))
    (told,) = calibrate(search, fit, [NamePosterior(0.9, ())], {})
    assert floor.values(x)[0] == pytest.approx(friction)
    assert told.probability == pytest.approx(sure)


def test_a_number_that_is_as_far_as_it_may_go_makes_up_for_something_else(worn):
    _, search, _ = worn
    tilt = Candidate.of(known_effects()["ground_tilt"], (), (0.0, 0.0))
    for x, sure in ((tilt.bounds()[1] * [0.1, 1.0], 0.45), (tilt.bounds()[1] * [0.1, 0.9], 0.9), (np.zeros(2), 0.9)):
        fit = replace(search.evaluate([]), effects=(tilt,), x=x, covariance=np.full((2, 2), np.inf))
        assert calibrate(search, fit, [NamePosterior(0.9, ())], {})[0].probability == pytest.approx(sure)


def test_what_may_be_nothing_is_less_sure_a_mass_by_itself_other_numbers_together(worn):
    _, search, _ = worn
    tilt = Candidate.of(known_effects()["ground_tilt"], (), (0.0, 0.0))
    mass = PointMass.of(known_effects()["payload"], ("two_link",), (0.0, 0.0, 0.0, 0.0))

    def told(c, x, deviations):
        fit = replace(search.evaluate([]), effects=(c,), x=np.array(x), covariance=np.diag(np.square(deviations)))
        return calibrate(search, fit, [NamePosterior(0.9, ())], {})[0].probability

    assert told(tilt, [0.1, 2.0], [0.5, 0.5]) == pytest.approx(0.9)
    assert told(tilt, [0.1, 0.9], [0.5, 0.5]) == pytest.approx(0.45)
    assert told(mass, [0.4, 3.0, 0.0, 1.0], [0.5, 0.1, 0.1, 0.1]) == pytest.approx(0.45)
    assert told(mass, [1.8, 3.0, 0.0, 1.0], [0.5, 0.1, 0.1, 0.1]) == pytest.approx(0.9)
    assert told(mass, [0.4, 3.0, 0.0, 1.0], [np.inf, 0.1, 0.1, 0.1]) == pytest.approx(0.9)  # nothing is known of it


def test_a_load_that_may_weigh_nothing_is_another_centre_of_mass_where_that_stands_beside_it(worn):
    _, search, _ = worn
    mass = PointMass.of(known_effects()["payload"], ("two_link",), (0.0, 0.0, 0.0, 0.0))
    other = Candidate.of(known_effects()["com_shift"], ("two_link",), (0.0, 0.0, 0.0))
    beside = NamePosterior(0.6, (Rival(other, np.ones(3), 10.0, 0.3),))

    def told(deviations):
        fit = replace(search.evaluate([]), effects=(mass,), x=np.array([0.4, 3.0, 0.0, 1.0]),
                      covariance=np.diag(np.square(deviations)))
        return calibrate(search, fit, [beside], {})[0].probability

    assert told([0.5, 0.1, 0.1, 0.1]) == pytest.approx(0.6)
    assert told([0.5, 4.0, 1.0, 2.0]) == pytest.approx(0.3)


def test_a_rival_begins_where_it_does_the_same_as_the_other(worn):
    """A load that hardly weighs but moves the centre of mass: the centre alone, begun elsewhere, is put where the load has it."""
    session, search, _ = worn
    k = session.model.kinematics
    link = k.frames["two"].child
    mass = PointMass.of(known_effects()["payload"], (link,), (0.0, *k.centers[link]))
    other = Candidate.of(known_effects()["com_shift"], (link,), (0.0, 0.0, 0.0))
    fit = search.evaluate([(mass, np.array([0.2, 0.0, 2.0, -1.0]))])
    astray = CandidateFit(other, np.array([9.0, 9.0, 9.0]), {"fit": 1e9, "choose": 1e9}, None)
    seen = []
    part = replace_effect(search, fit, 0, astray)
    questions = next(part)
    try:
        while True:
            seen += [q.model.effects[0].parameters["offset"] for q in questions]
            questions = part.send(search.evaluator.residuals(questions))
    except StopIteration:
        pass
    m, at = mass.values(fit.x)[0], np.array(mass.values(fit.x)[1:])
    expected = m / (m + k.masses[link]) * (at - k.centers[link])
    assert seen[0] == pytest.approx((0.045, 0.045, 0.045))
    assert seen[1] == pytest.approx(expected)


def test_what_floating_base_takes_identified_is_weighed_on_all_that_was_fitted_too():
    """Twice as many stretches are fitted: where these say the opposite, they count as much as those that choose."""
    assert better_by_both(fit_of(choose=1000.0, fit=2000.0), fit_of(choose=1100.0, fit=1600.0)) == pytest.approx(50.0)


@pytest.mark.parametrize(("name", "choose", "told"), [("payload", 900.0, True), ("payload", 1300.0, False),
                                                      ("stribeck_friction", 900.0, False), ("viscous_friction", 900.0, False)])
def test_a_name_that_only_the_price_of_its_numbers_keeps_out_stands_beside(name, choose, told):
    """A load that swings little is nearly a spring; Stribeck friction is dry friction with something added."""
    rival = candidate(name, *(("base",) if name == "payload" else ("one",)))
    fit = fit_of([candidate("coulomb_friction", "one")], choose=1000.0, fit=2000.0)
    assert is_outpriced(search_on("fixed"), fit, 0, fit_of([rival], choose=choose, fit=2 * choose)) is told


@pytest.mark.parametrize(("held", "name", "told"), [(0.0, "tether_force", True), (500.0, "tether_force", False),
                                                    (0.0, "payload", False)])
def test_a_pull_is_the_twin_of_a_tilt_that_only_floating_base_takes_identify(held, name, told):
    tilt, other = (Candidate.of(known_effects()[n], (), (0.0,) * len(candidate(n).neutral)) for n in ("ground_tilt", name))
    fit = fit_of([tilt], {0: leaving(100.0), 1: leaving(900.0)}, choose=1000.0)
    rival = fit_of([other], {0: leaving(100.0 + held), 1: leaving(2000.0)})
    assert is_equivalent(search_on("fixed", "free"), fit, 0, rival) is told


@pytest.mark.parametrize(("walks", "adds"), [(30.0, 2.0), (5000.0, ODDS.most_from_floating), (-5000.0, -ODDS.most_from_floating)])
def test_fixed_base_takes_take_the_word_first_of_what_they_told(walks, adds):
    """Take 0 is held, take 1 walks."""
    fit, rival = (fit_of((), {0: leaving(held), 1: leaving(walk)}) for held, walk in ((100.0, 9000.0), (120.0, 9000.0 - walks)))
    assert better_on_fixed_base(search_on("fixed", "free"), fit, rival) == pytest.approx(adds - 20.0)


def test_a_rival_that_was_not_fitted_has_its_numbers_all_the_same(worn):
    _, search, _ = worn
    mass = PointMass.of(known_effects()["payload"], ("two_link",), (0.0, 0.0, 0.0, 0.0))
    fit = replace(search.evaluate([]), effects=(mass,), x=np.ones(4), covariance=np.full((4, 4), np.inf))
    assert numbers_identified(fit, 0) == 4
    assert numbers_identified(replace(fit, covariance=np.diag([1.0, 1.0, 1.0, np.inf])), 0) == 3


def test_where_nothing_stays_nothing_is_compared(worn):
    _, search, _ = worn
    nominal = search.evaluate([])
    _, fit, posteriors = compare_models(search, SelectionResult(search, nominal, ()), lambda what, share: None)
    assert fit is nominal
    assert posteriors == []


def test_a_rival_must_lead_by_more_where_no_fit_is_right():
    search = search_on("fixed")
    expected = search.evaluator.expected_cost((0,), "choose")
    assert misfit(search, fit_of(choose=400.0 * expected)) == pytest.approx(400.0)
    assert misfit(search, fit_of(choose=0.6 * expected)) == 1.0


def test_what_goes_wrong_elsewhere_leaves_a_joints_rivals_no_more_to_chance():
    """A cable hangs on another joint of a robot whose joint's names are contested on a fixed base."""
    search, friction = search_on("fixed", "free"), candidate("coulomb_friction", "one")
    expected = search.evaluator.expected_cost((0,), "choose") / 2  # of one joint
    cost = 400.0 * search.evaluator.expected_cost(search.fitted, "choose")
    fit = fit_of((), {0: leaving(1.3 * expected, "one"), 1: leaving(0.0)}, choose=cost)
    own, whole = (CandidateFit(friction, np.ones(1), {"choose": 100.0}, joint) for joint in ("one", None))
    assert dispersion(search, fit, friction, own) == pytest.approx(1.3 * ODDS.temper)
    assert dispersion(search, fit, friction, whole) == pytest.approx(400.0 * FIT.overdispersion_free)


def test_twins_name_each_other():
    known = known_effects()
    assert all(e.name in known[other].equivalent_to for e in known.values() for other in e.equivalent_to)


def test_what_fine_steps_do_not_miss_is_hardly_believed(worn):
    _, search, _ = worn
    tilt = Candidate.of(known_effects()["ground_tilt"], (), (0.0, 0.0))
    fit = replace(search.evaluate([]), effects=(tilt,), x=np.array([0.1, 2.0]), covariance=np.diag([0.01, 0.01]))
    assert calibrate(search, fit, [NamePosterior(0.9, ())], {}, idle=[tilt])[0].probability == pytest.approx(0.18)
    assert calibrate(search, fit, [NamePosterior(0.9, ())], {})[0].probability == pytest.approx(0.9)


@pytest.mark.parametrize(("force", "down"), [((0.05, -0.05, -0.7), True), ((0.05, -0.05, 0.7), False), ((0.3, 0.0, -0.7), False)])
def test_a_pull_straight_down_is_no_cable(worn, force, down):
    """A mass of 71 g that hangs below a body and swings was called a tether of (-0.02, 0.03, -0.75) N."""
    _, search, _ = worn
    tether = Candidate.of(known_effects()["tether_force"], (), (0.0, 0.0, 0.0))
    fit = replace(search.evaluate([]), effects=(tether,), x=tether.sizes(force), covariance=np.diag([1e-4] * 3))
    assert calibrate(search, fit, [NamePosterior(0.9, ())], {})[0].probability == pytest.approx(0.45 if down else 0.9)
    left = list(downward_pulls(fit))
    assert bool(left) is down
    for u in left:
        assert (u.error, u.floor) == pytest.approx((0.7, 0.01 * tether.typical[2]))
        assert "71 g" in str(u.description)


@pytest.mark.parametrize(("likely", "sure"), [(0.4, 0.25), (0.2, 0.5)])
def test_a_load_is_less_sure_where_a_pull_straight_down_is_about_as_likely(worn, likely, sure):
    _, search, _ = worn
    mass = PointMass.of(known_effects()["payload"], ("two_link",), (0.0, 0.0, 0.0, 0.0))
    tether = Candidate.of(known_effects()["tether_force"], (), (0.0, 0.0, 0.0))
    fit = replace(search.evaluate([]), effects=(mass,), x=np.array([2.0, 0.1, 0.1, 0.1]), covariance=np.diag([1e-4] * 4))
    beside = NamePosterior(0.5, (Rival(tether, tether.sizes((0.02, 0.04, -1.3)), 241.0, likely),))
    assert calibrate(search, fit, [beside], {})[0].probability == pytest.approx(sure)


@pytest.mark.parametrize(("joint", "walks", "near"), [(None, True, ["com_shift(tail)"]), ("one", True, []), (None, False, [])])
def test_what_moves_another_links_centre_of_mass_is_put_in_its_place_on_a_walk_however_far_behind(joint, walks, near):
    """A race ends before walks have told such numbers: a tail's was 568 of 2488 behind the body's and ahead when fitted."""
    com, mass = known_effects()["com_shift"], known_effects()["payload"]

    def trial(effect, link, choose, screened_out=False):
        c = Candidate.of(effect, (link,), effect.neutral(None))
        return CandidateFit(c, np.zeros(c.size), {"fit": 2 * choose, "choose": choose}, joint, screened_out=screened_out)

    body, tail, load, foot = (trial(com, "body", 2488.0), trial(com, "tail", 1920.0), trial(mass, "tail", 1941.0),
                              trial(com, "foot", 0.0, screened_out=True))
    seats = {body.candidate.key: (SelectionStep(None, (body, load, tail, foot), (body,)), body)}
    search = search_on("free" if walks else "fixed")
    assert [str(t.candidate) for t in rivals_near(search, seats, [body.candidate], body.candidate, body.x)] == near
