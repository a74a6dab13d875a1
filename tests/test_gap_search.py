"""Evidence, fits and selection on a small arm whose joint `three` is stiffer than its model says."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap_sessions import record_arm
from workbench.effects.registry import known_effects
from workbench.gap import asked, selection, worth
from workbench.gap.candidate import Candidate
from workbench.gap.candidates import candidates
from workbench.gap.channels import ACROSS, joint_of
from workbench.gap.compare_session import roll_out, run_of
from workbench.gap.evidence import gather, ratios, smoothed
from workbench.gap.fitting import fit_blocks, together
from workbench.gap.jury import Jury, Question
from workbench.gap.ledger import layer_of, ledger
from workbench.gap.point_mass import PointMass, SwungMass
from workbench.gap.race import Trial
from workbench.gap.registered import read_takes, register_takes
from workbench.gap.rounds import Round, before_rough, taken
from workbench.gap.search import Search
from workbench.gap.session import load_session
from workbench.simulation import SimulationConfig

NOMINAL, HIDDEN = 0.06, 0.14
CONFIG = SimulationConfig(settle=0.5, time_step=2e-3, contact_period=0)


def gathered(folder, friction):
    record_arm(folder, friction=friction)
    session = load_session(folder / "session.yaml")
    takes, _ = read_takes(session)
    rollouts = roll_out([run_of(t) for t in takes], CONFIG, n_jobs=1)
    registered, _ = register_takes(session, takes, {t.spec.name: r.nominal for t, r in zip(takes, rollouts)})
    return session, gather(registered, {t.spec.name: r for t, r in zip(takes, rollouts)})


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    session, evidence = gathered(tmp_path_factory.mktemp("worn"), HIDDEN)
    search = Search(Jury(evidence, CONFIG, n_jobs=1), session.model)
    return session, search, search.evaluated([])


def test_residuals_are_as_large_as_noise_where_nothing_is_hidden(tmp_path):
    session, evidence = gathered(tmp_path, NOMINAL)
    residual = Jury(evidence, CONFIG, n_jobs=1).residuals([Question(session.model, (0,))])[0][0]
    assert list(ratios(evidence[0], residual).values()) == pytest.approx([1.0] * len(evidence[0].channels), abs=0.3)
    assert ledger(evidence, {0: residual}) == ()


def test_stretches_for_fitting_choosing_and_validating_do_not_meet(worn):
    uses = worn[1].jury.evidence[0].uses
    assert all(m.any() for m in uses.values())
    assert (sum(m.astype(int) for m in uses.values()) <= 1).all()


def test_a_search_stops_at_its_limit_of_work_and_says_so(worn, monkeypatch):
    session, search, _ = worn
    pool = [c for c in candidates(session.model, search.jury.evidence) if c.name == "viscous_friction"]
    monkeypatch.setattr(selection, "MOST_WORK", 0.0)
    monkeypatch.setattr(selection, "MOST_ROLLOUTS", 0.0)
    chosen = selection.select(search, pool, lambda what, share: None)
    assert chosen.stopped
    assert not chosen.fit.effects
    assert not selection.select(search, pool, lambda what, share: None, thorough=True).stopped


def test_only_walks_tell_what_held_takes_were_asked_before(worn):
    _, search, _ = worn
    effects = known_effects()
    friction = Candidate.of(effects["coulomb_friction"], ("three",), (0.0,))
    supply = Candidate.of(effects["supply_voltage"], (), (11.1,))
    both = (*search.takes, 7)  # take 7 walks, as it is not held
    assert search.telling([friction], both) == (7,)
    assert search.telling([friction, supply], both) == both
    assert search.telling([friction], search.takes) == search.takes


def test_the_ledger_books_the_worn_joint_alone_before_any_fit(worn):
    entries = ledger(worn[1].jury.evidence, worn[2].residuals)
    assert entries[0].where == ("three",)
    assert entries[0].layer == "actuator"
    assert entries[0].error > 2 * entries[0].floor
    assert {e.where for e in entries} == {("three",)}


def test_layers_are_told_by_where_a_channel_is_ill():
    assert layer_of("flm", late=False, only_on_the_ground=False) == "actuator"
    assert layer_of("flm", late=True, only_on_the_ground=True) == "timing"
    assert layer_of("flm", late=False, only_on_the_ground=True) == "ground"
    assert layer_of("flm~z", late=True, only_on_the_ground=False) == "structure"
    assert [layer_of(c, False, False) for c in ("roll", "forward")] == ["inertia", "ground"]


def test_running_means_of_noise_stay_one_and_those_of_an_offset_grow():
    noise = np.random.default_rng(0).normal(size=(4000, 1))
    assert np.std(smoothed(noise, 8)) == pytest.approx(1.0, abs=0.1)
    assert np.mean(smoothed(np.ones((100, 1)), 9)[20:-20]) == pytest.approx(3.0)


def test_one_rollout_tries_an_effect_at_all_joints_and_the_hidden_one_wins_at_its_size(worn):
    session, search, nominal = worn
    names = {"coulomb_friction", "viscous_friction", "servo_gain", "backlash"}  # a dead band does the same, to a hundredth
    pool = [c for c in candidates(session.model, search.jury.evidence) if c.name in names]
    groups = [[c for c in pool if c.name == name] for name in sorted(names)]
    assert all(len(g) == 3 for g in groups)
    trials = search.tried(nominal, groups, dict.fromkeys(range(len(groups)), (0,)), lambda share: None)
    best = max(trials, key=lambda t: t.gain["choose"])
    assert str(best.candidate) == "coulomb_friction(three)"
    assert NOMINAL + best.candidate.values(best.x)[0] == pytest.approx(HIDDEN, rel=0.06)
    refined = search.refined(search.refitted(search.evaluated([(best.candidate, best.x)]), (0,), 2))
    noise = np.count_nonzero(search.jury.vector(nominal.residuals, "validate"))
    assert refined.cost["validate"] - noise < 0.2 * (nominal.cost["validate"] - noise)
    (sd,) = np.sqrt(np.diag(refined.covariance))
    assert 0 < sd < 0.2 * refined.x[0]


def test_what_a_jury_remembers_it_does_not_simulate_again(worn, tmp_path):
    session, search, nominal = worn
    first = Jury(search.jury.evidence, CONFIG, n_jobs=1, memory=tmp_path)
    first.residuals([Question(session.model, (0,))])
    again = Jury(search.jury.evidence, CONFIG, n_jobs=1, memory=tmp_path)
    residual = again.residuals([Question(session.model, (0,))])[0][0]
    assert (first.rollouts, again.rollouts) == (1, 0)
    np.testing.assert_array_equal(residual, nominal.residuals[0])


def test_sizes_are_zero_where_an_effect_vanishes_and_one_where_it_is_typical(worn):
    for c in candidates(worn[0].model, worn[1].jury.evidence):
        if not c.neutral or isinstance(c, SwungMass):  # of that, test_gap_point_mass
            continue
        neutral = c.values(np.zeros(c.size))
        assert all(v == n or (n == np.inf and v == p.high) for v, n, p in zip(neutral, c.neutral, c.parameters)), str(c)
        ones = [2 * n if p.shapes else t for t, n, p in zip(c.typical, c.neutral, c.parameters)]
        assert c.values(np.ones(c.size)) == pytest.approx(ones)
        low, high = c.bounds()
        assert (low <= 0).all()
        assert (high >= 1).all()
        if isinstance(c, PointMass):  # its numbers are never held
            continue
        held = replace(c, held=(True,) * len(c.neutral))
        assert held.size == 0
        assert held.values(np.empty(0)) == pytest.approx(c.typical)


@pytest.mark.parametrize(("name", "own"), [("ground_friction", 0.4), ("foot_friction", 0.31), ("supply_voltage", 10.0)])
def test_a_robot_whose_own_value_is_the_typical_one_is_asked_about_another(name, own):
    c = Candidate.of(known_effects()[name], (), (own,))
    probed, = c.values(c.probes()[0])
    assert abs(probed - own) == pytest.approx(0.2 * own)
    np.testing.assert_allclose([c.values(end) for end in c.bounds()], [[c.parameters[0].high], [c.parameters[0].low]])
    far = Candidate.of(known_effects()[name], (), (1.5 * own,))
    assert far.values(far.probes()[0]) == [far.parameters[0].typical]


def test_blocks_are_fitted_apart_in_common_points_and_within_bounds():
    t = np.linspace(0, 1, 50)
    true = [np.array([2.0]), np.array([0.5, 3.0])]

    def left(point):
        return [np.exp(-true[0][0] * t) - np.exp(-point[0][0] * t),
                true[1][0] * np.sin(true[1][1] * t) - point[1][0] * np.sin(point[1][1] * t)]

    start = [np.array([1.0]), np.array([1.0, 2.0])]
    fit = fit_blocks(start, left(start), [(np.zeros(1), np.full(1, 1.5)), (np.zeros(2), np.full(2, 9.0))], 12)
    solved = together({"a": fit}, lambda wanted: [left(point) for _, point in wanted])["a"]
    assert solved[0].x == pytest.approx([1.5])  # its bound
    assert solved[1].x == pytest.approx(true[1], rel=1e-2)


def test_fits_side_by_side_are_answered_together():
    calls = []

    def asking(n):
        total = 0
        for _ in range(n):
            total += sum((yield [1, 2]))
        return total

    def answer(wanted):
        calls.append(len(wanted))
        return [10 * w for _, w in wanted]

    assert together({"one": asking(1), "two": asking(2)}, answer) == {"one": 30, "two": 60}
    assert calls == [4, 2]


def test_channels_across_an_axis_belong_to_their_joint():
    assert [joint_of(c) for c in ("flm", "flm~z", "roll")] == ["flm", "flm", "roll"]


def test_what_held_takes_told_keeps_its_numbers_beside_what_is_fitted_after(worn):
    session, evidence = worn[0], worn[1].jury.evidence
    search = Search(Jury(evidence, CONFIG, n_jobs=1), session.model)
    pool = {c.key: c for c in candidates(session.model, evidence)}
    first, second = pool["coulomb_friction", ("three",)], pool["viscous_friction", ("two",)]
    told = search.settled = search.refitted(search.evaluated([(first, np.array([1.0]))]), (0,), 2)
    both = search.refitted(search.evaluated([(second, np.array([0.3])), *told.sizes()]), (0,), 2)
    assert both.x[1] == told.x[0]
    assert both.covariance[1, 1] == told.covariance[0, 0]
    assert np.isinf(both.covariance[0, 1])
    assert both.x[0] != 0.3
    assert [s.numbers.tolist() for s in both.slopes] == [[0], [1]]
    np.testing.assert_array_equal(both.slopes[1].J, told.slopes[0].J)
    alone = search.resettled(search.evaluated([(second, np.array([0.1]))]), second)
    assert [c.key for c in search.settled.effects] == [second.key]
    assert alone.x == pytest.approx(search.settled.x)


def test_joints_of_a_held_robot_are_fitted_side_by_side(worn):
    session, search, _ = worn
    pool = {c.key: c for c in candidates(session.model, search.jury.evidence)}
    first, second = pool["coulomb_friction", ("three",)], pool["viscous_friction", ("two",)]
    zero = Candidate.of(known_effects()["zero_offset"], ("one",), (0.0,))
    before = search.jury.rollouts
    fit = search.refitted(search.evaluated([(first, np.array([1.3])), (second, np.array([0.2]))]), (0,), 1)
    assert search.jury.rollouts - before == 3  # as they are, both moved, where that leads
    assert [(s.joint, s.numbers.tolist()) for s in fit.slopes] == [("three", [0]), ("two", [1])]
    assert np.isfinite(np.diag(fit.covariance)).all()
    assert 0.06 + first.values(fit.x[:1])[0] == pytest.approx(HIDDEN, rel=0.1)
    mixed = search.refitted(search.evaluated([(first, fit.x[:1]), (zero, np.array([0.1]))]), (0,), 1)
    assert [s.joint for s in mixed.slopes] == [None]  # its own joint does not show it


def test_a_number_is_as_unsure_as_it_differs_between_contact_models(worn):
    session, search, _ = worn
    (e,) = search.jury.evidence
    effect = next(c for c in candidates(session.model, (e,)) if c.key == ("coulomb_friction", ("three",)))
    alike = search.refitted(search.evaluated([(effect, np.array([2.0]))]), (0,), 2)
    assert not e.contact.any()
    moved = search.evaluated([(effect, alike.x + 0.5)]).residuals[0] - alike.residuals[0]
    differing = Search(search.jury.on([replace(e, contact=np.nan_to_num(moved) * e.sigma)]), session.model)
    unsure = differing.refitted(differing.evaluated([(effect, np.array([2.0]))]), (0,), 2)
    assert unsure.x == pytest.approx(alike.x)
    assert np.sqrt(unsure.covariance[0, 0] - alike.covariance[0, 0]) == pytest.approx(0.5, rel=0.15)


@pytest.mark.parametrize("walks", [False, True])
def test_what_earlier_effects_may_err_by_counts_where_they_act_and_hides_nothing_elsewhere(worn, monkeypatch, walks):
    session, whole, nominal = worn
    monkeypatch.setattr(whole.jury, "walks", lambda takes: walks)
    search = Search(whole.jury, session.model)
    taken = next(c for c in candidates(session.model, whole.jury.evidence) if c.key == ("coulomb_friction", ("three",)))
    names = whole.jury.evidence[0].channels
    n = names.index("three")
    residual = nominal.residuals[0].copy()
    residual[:, n] *= 30
    before = replace(nominal, residuals={0: residual})
    search.settled = replace(search.evaluated([(taken, np.array([2.6]))]), residuals=nominal.residuals)
    first = Round(before, (), (Trial(taken, np.array([2.6]), {"fit": 1e6, "choose": 1e6}, "three"),))
    tilt = Candidate.of(known_effects()["ground_tilt"], (), (0.0, 0.0))

    def trial(channel):
        gain = np.where(np.arange(len(names)) == names.index(channel), 2000.0, 0.0)
        return Trial(tilt, np.ones(2), {"fit": 4000.0, "choose": 2000.0}, None, closed=0.9, by_channel=gain)

    assert worth.worthwhile(search, trial("two"), (0,), [first], search.settled)
    assert not worth.worthwhile(search, trial("three"), (0,), [first], search.settled)


def test_with_the_base_held_what_is_left_in_one_joint_is_not_too_little_beside_what_another_had(worn):
    session, whole, nominal = worn
    search = Search(whole.jury, session.model)
    names = whole.jury.evidence[0].channels
    taken = Candidate.of(known_effects()["thermal_fade"], (), (0.0,))

    def fit(**sizes):
        left = 0.5 * np.ones_like(nominal.residuals[0])
        for joint, size in sizes.items():
            left[:, names.index(joint)] = size
        return replace(nominal, residuals={0: left})

    first = Round(fit(three=100.0), (), (Trial(taken, np.ones(1), {"fit": 1e7, "choose": 1e7}, None),))
    assert worth.too_little_left(search, fit(three=10.0), (0,), [first])
    assert not worth.too_little_left(search, fit(three=40.0), (0,), [first])
    assert not worth.too_little_left(search, fit(two=10.0), (0,), [first])


def test_on_the_ground_a_joint_is_not_too_little_beside_what_held_takes_told_of_others(worn, monkeypatch):
    session, whole, nominal = worn
    search = Search(whole.jury, session.model)
    names = whole.jury.evidence[0].channels
    taken = Candidate.of(known_effects()["thermal_fade"], (), (0.0,))

    def fit(**sizes):
        left = 0.5 * np.ones_like(nominal.residuals[0])
        for joint, size in sizes.items():
            left[:, names.index(joint)] = size
        return replace(nominal, residuals={0: left})

    first = Round(fit(three=100.0, two=15.0), (), (Trial(taken, np.ones(1), {"fit": 1e6, "choose": 1e6}, None),))
    search.settled = replace(search.evaluated([(taken, np.ones(1))]), residuals=nominal.residuals)
    monkeypatch.setattr(whole.jury, "walks", lambda takes: True)
    assert not worth.too_little_left(search, fit(two=13.0), (0,), [first])
    assert worth.too_little_left(search, fit(three=13.0), (0,), [first])
    search.settled = None
    assert worth.too_little_left(search, fit(two=13.0), (0,), [first])


@pytest.mark.parametrize(("name", "left", "share"), [
    ("backlash", {}, worth.LEAST_CLOSED), ("backlash", {"three": 2.0}, worth.LEAST_CLOSED),
    ("backlash", {"three": 30.0}, worth.LAST_CLOSED), ("dead_band", {"three": 2.0}, worth.LEAST_CLOSED),
    ("dead_band", {"three": 30.0}, worth.LAST_CLOSED)])
def test_beside_a_joint_that_no_name_fits_an_effect_on_the_ground_has_to_be_half(worn, name, left, share):
    session, whole, nominal = worn
    search = Search(whole.jury, session.model)
    names = whole.jury.evidence[0].channels

    def fit(effects, **sizes):
        there = 0.5 * np.ones_like(nominal.residuals[0])
        for joint, size in sizes.items():
            there[:, names.index(joint)] = size
        return replace(nominal, residuals={0: there}, effects=effects)

    given = next(c for c in candidates(session.model, whole.jury.evidence) if c.key == (name, ("three",)))
    assert worth.least_closed(search, fit((), three=40.0), fit((given,), **left)) == share


def test_what_is_well_hides_no_gap_and_closes_none(worn):
    jury = worn[1].jury
    e = jury.evidence[0]
    quiet = 0.5 * np.ones_like(worn[2].residuals[0])
    ill, better = quiet.copy(), quiet.copy()
    ill[:, e.channels.index("two")] = 3.0
    better[:, e.channels.index("two")] = 2.0
    assert jury.beyond({0: quiet}, "choose") == 0
    assert jury.closed({0: ill}, {0: quiet}, "choose") == 1
    assert 0.4 < jury.closed({0: ill}, {0: better}, "choose") < 0.8
    assert jury.closed({0: ill}, {0: better}, "choose", "one") == 0
    assert jury.closed({0: quiet}, {0: ill}, "choose") == 0


@pytest.mark.parametrize(("gaps", "expected"), [
    ({"one": 6.7, "two": 2.6, "pitch": 1.5}, {"one"}),
    ({"one": 6.7, "two": 4.0}, set()),
    ({"one": 6.7, "pitch": 5.0}, set()),
    ({"pitch": 6.7, "one": 2.0}, set()),
    ({"one across x": 6.7, "two": 2.0}, {"one"}),
    ({}, set()),
])
def test_a_joint_stands_out_where_nothing_else_errs_a_quarter_as_much(monkeypatch, gaps, expected):
    named = {c.replace(" across ", ACROSS): s for c, s in gaps.items()}
    monkeypatch.setattr(asked, "channel_gaps", lambda e, residual: named)
    search = SimpleNamespace(grounded=lambda takes: takes, jury=SimpleNamespace(evidence=[None]),
                             nominal=SimpleNamespace(joints=("one", "two")))
    assert asked.standing_out(search, SimpleNamespace(residuals={0: None}), (0,)) == expected
    search.grounded = lambda takes: ()
    assert asked.standing_out(search, SimpleNamespace(residuals={0: None}), (0,)) == set()


@pytest.mark.parametrize(("base", "tier", "said"), [("fixed", 2, False), ("free", 2, False), ("free", 5, True)])
def test_what_closes_most_of_a_joint_does_not_keep_links_from_being_asked_with_the_base_held(base, tier, said):
    """What a hand carries looks like a weak shoulder."""
    search = SimpleNamespace(jury=SimpleNamespace(walks=lambda takes: base == "free"), grounded=lambda takes: ())
    shoulder = Candidate.of(known_effects()["servo_gain"], ("one",), (1.0,))
    for closed, enough in ((0.7, said), (0.98, True), (0.5, False)):
        trial = Trial(shoulder, np.ones(1), {"fit": 9e3, "choose": 5e3}, "one", closed=closed)
        assert selection._says_it(search, None, trial, (0,), tier) is enough


@pytest.mark.parametrize(("spring", "stop", "chosen"), [(5.6e7, 3.9e7, ["joint_stop"]), (5.6e7, 2.0e7, ["parallel_spring"]),
                                                        (3.0e7, 3.9e7, ["joint_stop"])])
def test_a_stop_that_recordings_show_goes_before_a_stiff_spring_that_imitates_it(spring, stop, chosen):
    """Beside a load and a weak elbow a spring closed more of a shoulder's gap than the stop at which all recordings end."""
    known = known_effects()
    at_stop = Candidate.of(known["joint_stop"], ("one",), (-180.0, 57.0), (-180.0, 6.0), (True, False))
    stiff = Candidate.of(known["parallel_spring"], ("one",), (0.0,))
    trials = [Trial(c, np.ones(1), {"fit": 2 * g, "choose": g}, "one", closed=0.6) for c, g in ((stiff, spring), (at_stop, stop))]
    choices = selection._accepted(sorted(trials, key=lambda t: -t.gain["choose"]))
    assert [[t.candidate.name for t in c] for c in choices] == [chosen]


def test_beside_a_pull_no_tilt_is_asked(worn):
    _, search, nominal = worn
    tilt = Candidate.of(known_effects()["ground_tilt"], (), (0.0, 0.0))
    pull = Candidate.of(known_effects()["tether_force"], (), (0.0, 0.0, 0.0))
    pulled = SimpleNamespace(effects=(pull,), residuals=nominal.residuals, sizes=lambda: [(pull, np.ones(3))])
    for current, groups in ((nominal, [[[tilt]]]), (pulled, [])):
        asked_of = [asked.asked(search, [tilt], current, {"one": 3.0, "two": 3.0}, search.held, tier)[0]
                    for tier in range(asked.TIERS)]
        assert [g for g in asked_of if g] == groups


def test_on_the_ground_what_was_read_off_is_asked_of_joints_that_were_well_while_held(worn, monkeypatch):
    """A stop may lie beyond what was moved then, and gravity may have left a loose mount on one side."""
    _, search, nominal = worn
    well = next(iter(asked._when_held(search, nominal)[0]))
    monkeypatch.setattr(search, "grounded", lambda takes: takes)
    mount = Candidate.of(known_effects()["loose_mount"], (well,), (0.0, 1.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0),
                         (False, True, True, True))
    band = Candidate.of(known_effects()["dead_band"], (well,), (0.0,))
    groups = [g for tier in range(asked.TIERS)
              for g in asked.asked(search, [mount, band], nominal, {well: 3.0}, search.held, tier)[0]]
    assert groups == [[mount]]


def test_of_a_held_robot_what_acts_on_all_of_it_is_asked_before_many_joints(worn):
    session, search, nominal = worn
    pool = candidates(session.model, search.jury.evidence)

    def asked_of(*joints):
        return [[c for g in asked.asked(search, pool, nominal, dict.fromkeys(joints, 3.0), search.held, tier)[0] for c in g]
                for tier in range(asked.TIERS)]

    of_all, at_joints, *others = asked_of("one", "two", "three")[1:]
    assert {c.name for c in of_all} >= {"supply_voltage", "timing_drift"}
    assert all(not c.where for c in of_all)
    assert {c.joint for c in at_joints} == {"one", "two", "three"}
    assert all(c.joint is None and c.where for tier in others for c in tier)
    of_all, at_joints, *_ = asked_of("two", "three")[1:]
    assert not of_all
    assert {c.joint for c in at_joints} == {None, "two", "three"}


@pytest.mark.parametrize("zeroed", [True, False])
def test_zeros_of_a_held_robot_are_asked_about_where_the_recording_has_its_own(worn, zeroed):
    session, search, nominal = worn
    e = search.jury.evidence[0]
    seen = replace(e, take=replace(e.take, recorded=replace(e.take.recorded, zeroed=zeroed)))
    search = Search(search.jury.on([seen]), session.model)
    pool = [Candidate.of(known_effects()["zero_offset"], (j,), (0.0,)) for j in session.model.joints]
    groups = [g for tier in range(asked.TIERS) for g in asked.asked(search, pool, nominal, {"two": 3.0}, search.held, tier)[0]]
    assert [[c.where for c in g] for g in groups] == ([] if zeroed else [[("two",)]])


def test_what_held_takes_told_is_judged_on_them_alone(monkeypatch):
    monkeypatch.setattr(worth, "standing_out", lambda *_: set())
    c = Candidate.of(known_effects()["timing_drift"], (), (0.0,))
    fit = SimpleNamespace(residuals={0: np.ones(1), 1: np.ones(1)})
    for settled, looked_at in ((True, [0]), (False, [0, 1])):
        search = SimpleNamespace(held=(0,), fitted=(0, 1), is_settled=lambda _, s=settled: s, jury=SimpleNamespace(
            closed=lambda before, after, use, joint, takes=looked_at: 1.0 if list(before) == list(after) == takes else 0.0))
        r = Round(fit, (), ())
        assert worth.completed(search, r, Trial(c, np.ones(1), {}, None), fit) == 1.0


def test_what_walks_tell_of_a_joint_is_judged_by_its_own_gap_and_by_all_that_is_not_others(monkeypatch):
    monkeypatch.setattr(worth, "standing_out", lambda *_: set())

    def of(name, joint):
        return Candidate.of(known_effects()[name], (joint,), (0.0,) * len(known_effects()[name].parameters))

    own_effect, other = of("coulomb_friction", "two"), of("backlash", "three")
    fit = SimpleNamespace(residuals={0: np.ones(1)}, effects=(own_effect, other))
    trial = Trial(own_effect, np.ones(1), {}, None)
    for own, elsewhere, share in ((1.0, 0.6, 0.8), (0.0, 0.6, 0.6), (0.2, 0.6, 0.6)):  # a zero shows in other joints alone
        shares = {("two", ()): own, (None, ()): 0.2, (None, ("three",)): elsewhere}
        jury = SimpleNamespace(closed=lambda before, after, use, joint=None, without=(), of=shares: of[joint, tuple(without)])
        search = SimpleNamespace(held=(), fitted=(0,), is_settled=lambda _: False, jury=jury)
        assert worth.completed(search, Round(fit, (), ()), trial, fit) == pytest.approx(share)


def test_what_cameras_and_clocks_explain_hides_no_hundredths_of_physics():
    def accepted(name, *where):
        return (Trial(Candidate.of(known_effects()[name], where, (0.0,)), np.ones(1), {}, None),)

    clock, frame, sag, now = accepted("clock_rate"), accepted("marker_frame", "A"), accepted("supply_sag"), SimpleNamespace()
    rounds = [Round("nominal", (), clock), Round("nominal", (), frame)]
    assert before_rough(rounds, now) is now
    assert before_rough([*rounds, Round("seen rightly", (), sag)], now) == "seen rightly"
    assert taken([*rounds, Round("seen rightly", (), sag)]) == [*sag]
