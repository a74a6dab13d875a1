"""Evidence and fits on a small arm whose joint `three` is stiffer than its model says."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap_worn import CONFIG, HIDDEN, NOMINAL, gathered
from workbench.compare.channels import joint_of
from workbench.effects.registry import known_effects
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.fitting.levenberg_marquardt import fit_blocks
from workbench.identify.fitting.lockstep import together
from workbench.identify.ledger import layer_of, ledger
from workbench.identify.parameters import Candidate
from workbench.identify.point_mass import PointMass, SwungMass
from workbench.identify.problem import ratios, running_means
from workbench.identify.proposals import candidates
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.identify.selection import forward
from workbench.identify.selection.options import FORWARD
from workbench.identify.selection.screening import fit_groups


def test_residuals_are_as_large_as_noise_where_nothing_is_hidden(tmp_path):
    session, evidence = gathered(tmp_path, NOMINAL)
    residual = RolloutEvaluator(evidence, CONFIG, n_jobs=1).residuals([RolloutRequest(session.model, (0,))])[0][0]
    assert list(ratios(evidence[0], residual).values()) == pytest.approx([1.0] * len(evidence[0].channels), abs=0.3)
    assert ledger(evidence, {0: residual}) == ()


def test_stretches_for_fitting_choosing_and_validating_do_not_meet(worn):
    uses = worn[1].evaluator.evidence[0].uses
    assert all(m.any() for m in uses.values())
    assert (sum(m.astype(int) for m in uses.values()) <= 1).all()


def test_a_search_stops_at_its_limit_of_work_and_says_so(worn, monkeypatch):
    session, search, _ = worn
    pool = [c for c in candidates(session.model, search.evaluator.evidence) if c.name == "viscous_friction"]
    monkeypatch.setattr(forward, "FORWARD", replace(FORWARD, most_work=0.0, most_rollouts=0.0))
    chosen = forward.select(search, pool, lambda what, share: None)
    assert chosen.stopped
    assert not chosen.fit.effects
    assert not forward.select(search, pool, lambda what, share: None, thorough=True).stopped


def test_what_was_tried_when_the_limit_of_work_came_decides(worn, monkeypatch):
    session, search, _ = worn
    pool = [c for c in candidates(session.model, search.evaluator.evidence) if c.name == "coulomb_friction"]
    monkeypatch.setattr(forward, "_says_it", lambda *a: False)  # it would ask for more
    enough = search.evaluator.memory.work + 2 * search.evaluator.seconds
    monkeypatch.setattr(forward, "FORWARD", replace(FORWARD, most_work=enough, most_rollouts=0.0))
    chosen = forward.select(search, pool, lambda what, share: None)
    assert chosen.stopped
    assert [c.key for c in chosen.fit.effects] == [("coulomb_friction", ("three",))]


def test_work_is_counted_in_seconds_of_a_puppys_rollout(worn):
    evaluator = worn[1].evaluator
    (e,) = evaluator.evidence
    assert len(e.joints) == 3
    assert evaluator.seconds == pytest.approx(float(e.take.recorded.time[-1]) * 20 / 32)


def test_only_floating_base_takes_identify_what_fixed_base_takes_were_asked_before(worn):
    _, search, _ = worn
    effects = known_effects()
    friction = Candidate.of(effects["coulomb_friction"], ("three",), (0.0,))
    supply = Candidate.of(effects["supply_voltage"], (), (11.1,))
    both = (*search.takes, 7)  # take 7 walks, as it is not held
    assert search.telling([friction], both) == (7,)
    assert search.telling([friction, supply], both) == both
    assert search.telling([friction], search.takes) == search.takes


def test_the_ledger_books_the_worn_joint_alone_before_any_fit(worn):
    entries = ledger(worn[1].evaluator.evidence, worn[2].residuals)
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
    assert np.std(running_means(noise, 8)) == pytest.approx(1.0, abs=0.1)
    assert np.mean(running_means(np.ones((100, 1)), 9)[20:-20]) == pytest.approx(3.0)


def test_one_rollout_tries_an_effect_at_all_joints_and_the_hidden_one_wins_at_its_size(worn):
    session, search, nominal = worn
    names = {"coulomb_friction", "viscous_friction", "servo_gain", "backlash"}  # a dead band does the same, to a hundredth
    pool = [c for c in candidates(session.model, search.evaluator.evidence) if c.name in names]
    groups = [[c for c in pool if c.name == name] for name in sorted(names)]
    assert all(len(g) == 3 for g in groups)
    trials = fit_groups(search, nominal, groups, dict.fromkeys(range(len(groups)), (0,)), lambda share: None)
    best = max(trials, key=lambda t: t.gain["choose"])
    assert str(best.candidate) == "coulomb_friction(three)"
    assert NOMINAL + best.candidate.values(best.x)[0] == pytest.approx(HIDDEN, rel=0.06)
    refined = search.refine(search.refit(search.evaluate([(best.candidate, best.x)]), (0,), 2))
    noise = np.count_nonzero(search.evaluator.vector(nominal.residuals, "validate"))
    assert refined.cost["validate"] - noise < 0.2 * (nominal.cost["validate"] - noise)
    (sd,) = np.sqrt(np.diag(refined.covariance))
    assert 0 < sd < 0.2 * refined.x[0]


def test_what_a_jury_remembers_it_does_not_simulate_again(worn, tmp_path):
    session, search, nominal = worn
    first = RolloutEvaluator(search.evaluator.evidence, CONFIG, n_jobs=1, memory=tmp_path)
    first.residuals([RolloutRequest(session.model, (0,))])
    again = RolloutEvaluator(search.evaluator.evidence, CONFIG, n_jobs=1, memory=tmp_path)
    residual = again.residuals([RolloutRequest(session.model, (0,))])[0][0]
    assert (first.memory.played, again.memory.played) == (1, 0)
    assert first.memory.rollouts == again.memory.rollouts == 1
    np.testing.assert_array_equal(residual, nominal.residuals[0])


def test_sizes_are_zero_where_an_effect_vanishes_and_one_where_it_is_typical(worn):
    for c in candidates(worn[0].model, worn[1].evaluator.evidence):
        if not c.neutral or isinstance(c, SwungMass):  # of that, test_point_mass
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
        held = replace(c, fixed=(True,) * len(c.neutral))
        assert held.size == 0
        assert held.values(np.empty(0)) == pytest.approx(c.typical)


@pytest.mark.parametrize(("name", "own", "asked"), [("supply_voltage", 5.0, 4.0), ("supply_voltage", 7.4, 5.92),
                                                    ("supply_voltage", 12.0, 10.0), ("ground_friction", 0.3, 0.24)])
def test_a_robot_with_little_of_its_own_is_asked_about_less(name, own, asked):
    """A small servo's supply of 5 V fails at 4 V; at the 10 V that a larger one feels first it would only be stronger."""
    effect = known_effects()[name]
    assert effect.parameters[0].typical_beside(own) == pytest.approx(asked)


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


def test_what_fixed_base_takes_identified_keeps_its_numbers_beside_what_is_fitted_after(worn):
    session, evidence = worn[0], worn[1].evaluator.evidence
    search = Search(RolloutEvaluator(evidence, CONFIG, n_jobs=1), session.model)
    pool = {c.key: c for c in candidates(session.model, evidence)}
    first, second = pool["coulomb_friction", ("three",)], pool["viscous_friction", ("two",)]
    told = search.refit(search.evaluate([(first, np.array([1.0]))]), (0,), 2)
    search = search.with_settled(told)
    both = search.refit(search.evaluate([(second, np.array([0.3])), *told.sizes()]), (0,), 2)
    assert both.x[1] == told.x[0]
    assert both.covariance[1, 1] == told.covariance[0, 0]
    assert np.isinf(both.covariance[0, 1])
    assert both.x[0] != 0.3
    assert [s.numbers.tolist() for s in both.slopes] == [[0], [1]]
    np.testing.assert_array_equal(both.slopes[1].J, told.slopes[0].J)
    search, alone = search.resettle(search.evaluate([(second, np.array([0.1]))]), second)
    assert [c.key for c in search.settled.effects] == [second.key]
    assert alone.x == pytest.approx(search.settled.x)


@pytest.mark.parametrize(("left", "late"), [(60.0, 3.4), (500.0, 2.5)], ids=["held takes allow it", "held takes contradict it"])
def test_most_from_floating_when_commands_come_unless_fixed_base_takes_contradict_it(left, late):
    delay = Candidate.of(known_effects()["command_delay"], ("three",), (0.0,))

    def fit(x, held):
        return Fit((delay,), np.array([x]), np.eye(1), {}, {0: np.array([[held]]), 1: np.zeros((1, 1))})

    search = SimpleNamespace(
        fixed_base=(0,),
        fitted=(0, 1),
        floating_base=lambda takes: (1,),
        refit=lambda *_: fit(3.4, left),
        evaluator=SimpleNamespace(cost=lambda residuals, use: float(sum(r.sum() for r in residuals.values()))),
    )
    assert Search.refit_timing(search, fit(2.5, 10.0)).x.tolist() == [late]


def test_joints_of_a_held_robot_are_fitted_side_by_side(worn):
    session, search, _ = worn
    pool = {c.key: c for c in candidates(session.model, search.evaluator.evidence)}
    first, second = pool["coulomb_friction", ("three",)], pool["viscous_friction", ("two",)]
    zero = Candidate.of(known_effects()["zero_offset"], ("one",), (0.0,))
    before = search.evaluator.memory.rollouts
    fit = search.refit(search.evaluate([(first, np.array([1.3])), (second, np.array([0.2]))]), (0,), 1)
    assert search.evaluator.memory.rollouts - before == 3  # as they are, both moved, where that leads
    assert [(s.joint, s.numbers.tolist()) for s in fit.slopes] == [("three", [0]), ("two", [1])]
    assert np.isfinite(np.diag(fit.covariance)).all()
    assert 0.06 + first.values(fit.x[:1])[0] == pytest.approx(HIDDEN, rel=0.1)
    mixed = search.refit(search.evaluate([(first, fit.x[:1]), (zero, np.array([0.1]))]), (0,), 1)
    assert [s.joint for s in mixed.slopes] == [None]  # its own joint does not show it


def test_a_number_is_as_unsure_as_it_differs_between_contact_models(worn):
    session, search, _ = worn
    (e,) = search.evaluator.evidence
    effect = next(c for c in candidates(session.model, (e,)) if c.key == ("coulomb_friction", ("three",)))
    alike = search.refit(search.evaluate([(effect, np.array([2.0]))]), (0,), 2)
    assert not e.contact.any()
    moved = search.evaluate([(effect, alike.x + 0.5)]).residuals[0] - alike.residuals[0]
    differing = Search(search.evaluator.on([replace(e, contact=np.nan_to_num(moved) * e.sigma)]), session.model)
    unsure = differing.refit(differing.evaluate([(effect, np.array([2.0]))]), (0,), 2)
    assert unsure.x == pytest.approx(alike.x)
    assert np.sqrt(unsure.covariance[0, 0] - alike.covariance[0, 0]) == pytest.approx(0.5, rel=0.15)
