"""Shortcuts of a search: starts from earlier responses, secant updates instead of differences, and no needless rollouts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap_worn import CONFIG, gathered
from workbench.effects.registry import known_effects
from workbench.identify.fitting.covariance import cluster_covariance
from workbench.identify.fitting.fits import Search
from workbench.identify.fitting.levenberg_marquardt import Solved, fit_blocks, lowest
from workbench.identify.fitting.lockstep import together
from workbench.identify.fitting.responses import linearised_estimate, scan
from workbench.identify.parameters import Candidate
from workbench.identify.rollouts.captured import channels_stream
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.identify.selection.options import SCREENING
from workbench.identify.selection.scheduling import well_on_fixed_base
from workbench.identify.selection.screening import CandidateEvaluation, Race, best_at, note_best
from workbench.robot import EffectSpec


class Walking(RolloutEvaluator):
    def any_floating(self, takes):
        return True


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    return gathered(tmp_path_factory.mktemp("quiet"), 0.06)


def friction():
    return Candidate.of(known_effects()["ground_friction"], (), (0.6,))


def test_an_effect_of_one_number_is_looked_at_at_several_sizes_within_its_bounds():
    c = friction()
    assert [c.values(p)[0] for p in scan(c, (0.7, 2.0), True)] == pytest.approx([0.46, 0.2])
    assert len(scan(c, (90.0, 99.0), True)) == 1  # both at the bound


def test_a_response_is_not_believed_far_beyond_where_it_was_looked_at():
    c = Candidate.of(known_effects()["command_delay"], (), (0.0,))
    r0 = np.ones(20)
    probes = scan(c, (0.7, 2.0), True)
    weak = [r0 - 0.01 * p[0] for p in probes]  # a line would say: a hundred times that
    x, gain = linearised_estimate(c, r0, probes, weak, SCREENING.far_walking)
    assert x[0] == pytest.approx(SCREENING.far_walking * 2.0)
    assert 0 < gain < 20
    slips = [r0, r0 - 1.0]  # nothing at the first size, all at the second
    assert linearised_estimate(c, r0, probes, slips, SCREENING.far_walking)[0] == pytest.approx([2.0])


def test_a_constant_that_may_be_too_large_is_simulated_without_it_and_on_a_walk_its_response_is_extended():
    c = Candidate.of(known_effects()["coulomb_friction"], ("flm",), (0.0,), lowest=(-0.06,))
    assert [c.values(p)[0] for p in scan(c, (1.0, 4.0), False)] == pytest.approx([0.03, 0.12, -0.06])
    probes = scan(c, (1.0,), True)
    assert [c.values(p)[0] for p in probes] == pytest.approx([0.03])
    more = np.linspace(-1.0, 1.0, 20)
    x, gain = linearised_estimate(c, 1.5 * more, probes, [2.5 * more], SCREENING.far_walking)
    assert x == pytest.approx([-1.5])
    assert gain == pytest.approx(2.25 * more @ more)
    held = scan(c, (1.0, 4.0), False)
    x, gain = linearised_estimate(c, more, held, [more, more, 0.2 * more], SCREENING.far)  # more of it changes nothing
    assert x == pytest.approx([-2.0])


def test_between_sizes_that_were_seen_a_guess_stays_where_these_lead():
    c = Candidate.of(known_effects()["servo_gain"], ("flm",), (1.0,))
    probes = scan(c, (1.0, 4.0), False)
    lag = np.sin(np.linspace(0, 6, 40))

    def shown(x):
        return lag * (1 / c.values(np.atleast_1d(x))[0] - 1)

    r0 = -shown(2.6)  # a line through the first alone says 4.3, where four times as much is missing
    x, gain = linearised_estimate(c, r0, probes, [r0 + shown(p) for p in probes], 5.0)
    assert 1.0 < x[0] < 2.6
    assert gain == pytest.approx(r0 @ r0)
    assert np.sum((r0 + shown(x)) ** 2) < 0.6 * (r0 @ r0)


def test_a_number_that_only_shapes_an_effect_is_looked_at_far_both_ways_and_is_not_scaled():
    c = Candidate.of(known_effects()["stribeck_friction"], ("flm",), (0.0, 20.0))
    probes = scan(c, (1.0, 4.0), False)
    assert sorted({round(c.values(p)[1]) for p in probes}) == [5, 20, 80]
    assert {p[1] for p in scan(c, (1.0,), True)} == {0.0}  # floating-base takes are expensive
    r0 = np.linspace(-1.0, 1.0, 20)
    fades = [r0 * (1 - 0.3 * p[0]) if p[1] == 2.0 else r0 + 0.01 * p[0] for p in probes]
    x, gain = linearised_estimate(c, r0, probes, fades, 5.0)
    assert x == pytest.approx([1 / 0.3, 2.0])
    assert gain == pytest.approx(r0 @ r0)


def test_rivals_know_the_best_at_their_joint_and_of_all():
    race = Race()
    note_best(race.reached, ["flm", None], [3.0, 8.0])
    note_best(race.reached, ["flm", "frm"], [5.0, -1.0])
    assert (best_at(race.reached, "flm"), best_at(race.reached, "frm"), best_at(race.reached, None)) == (5.0, 0.0, 8.0)


@pytest.mark.parametrize(("screened_out", "fitted"),
                         [((310, 230, 100), (310,)), ((296, 230, 100), (296, 230)), ((170, 160, 0), ())])
def test_where_no_rival_is_predicted_enough_the_best_of_those_near_it_are_fitted(screened_out, fitted):
    race = Race(least=300.0)
    asking = [
        CandidateEvaluation._worth_fitting(SimpleNamespace(race=race, joints=[None], walking=True, coarse=True), [g])
        for g in screened_out
    ]
    for a in asking:
        next(a)
    worth = []
    for g, a in zip(screened_out, asking):
        with pytest.raises(StopIteration) as end:
            next(a)
        worth += [g] * len(end.value.value)
    assert tuple(worth) == fitted


def test_what_an_earlier_race_predicts_to_be_hopeless_is_not_looked_at_again(quiet):
    session, evidence = quiet
    search = Search(Walking(evidence, CONFIG, n_jobs=1), session.model)
    current = search.evaluate([])
    power = {i: search.evaluator.cost({i: r}, "fit") for i, r in current.residuals.items()}
    c = Candidate.of(known_effects()["viscous_friction"], ("three",), (0.0,))
    r0 = search.evaluator.vector(current.residuals, "fit")
    assert power[0] > 0
    trials, asked = {}, []
    for best in (0.0, 1e9):  # of what rivals remember
        search.responses[(c.key, (0,))] = [np.array([1.0])], [[-0.5 * r0]]
        race = Race({None: best})
        parts = {
            0: CandidateEvaluation(
                search.evaluator, session.model, [], current.residuals, [c], race, False, search.responses
            ).run()
        }
        asked.clear()
        trials[best] = together(parts, lambda wanted: asked.extend(wanted) or search.evaluator.residuals([q for _, q in wanted]))[
            0
        ]
        assert bool(asked) == (best == 0.0)
    assert trials[1e9][0].screened_out
    assert search.telling([c], (0,)) == (0,)  # the one take is held


def test_what_is_rolled_out_for_a_while_is_as_in_the_whole_and_nothing_after(quiet):
    session, evidence = quiet
    evaluator = RolloutEvaluator(evidence, CONFIG, n_jobs=1)
    whole, brief = (
        r[0] for r in evaluator.residuals([RolloutRequest(session.model, (0,)), RolloutRequest(session.model, (0,), until=1.5)])
    )
    length = evidence[0].take.recorded.time[-1]
    assert evaluator.memory.work == pytest.approx((length + 1.5) / length * evaluator.seconds)
    since = evidence[0].since
    known = np.isfinite(brief).any(axis=1)
    assert since[known].max() == pytest.approx(1.5, abs=0.02)
    assert np.isfinite(whole[since > 1.6]).any()
    assert not np.isfinite(brief[since > 1.5]).any()


def test_each_rollout_is_kept_before_the_next_is_there(quiet, tmp_path, monkeypatch):
    session, evidence = quiet

    def killed(rollouts, n_jobs):
        yield next(channels_stream(rollouts, n_jobs))
        raise KeyboardInterrupt

    monkeypatch.setattr("workbench.identify.rollouts.evaluator.channels_stream", killed)
    with pytest.raises(KeyboardInterrupt):
        RolloutEvaluator(evidence, CONFIG, 1, tmp_path).residuals(
            [RolloutRequest(session.model, (0,)), RolloutRequest(session.model, (0,), until=1.5)]
        )
    again = RolloutEvaluator(evidence, CONFIG, 1, tmp_path)
    again.residuals([RolloutRequest(session.model, (0,))])
    assert again.memory.played == 0


def test_after_one_difference_per_number_slopes_are_updated_and_not_measured_again():
    t = np.linspace(0, 1, 60)
    true, asked = np.array([0.7, 2.0, -0.5]), []

    def left(x):
        asked.append(x)
        return true[0] * np.exp(-true[1] * t) + true[2] * t - x[0] * np.exp(-x[1] * t) - x[2] * t

    start = np.array([0.5, 1.5, -0.2])
    bounds = [(np.full(3, -5.0), np.full(3, 5.0))]
    fit = fit_blocks([start], [left(start)], bounds, 8)
    solved = together({0: fit}, lambda wanted: [[left(point[0])] for _, point in wanted])[0][0]
    assert solved.x == pytest.approx(true, rel=0.02)
    assert len(asked) <= 1 + 3 + 2 * 8


def test_a_fit_that_goes_on_does_not_step_again_where_it_stepped_in_vain():
    def left(x):
        return np.arctan(8.0 * (x - 1.0))  # the slope at the start sends a full step far beyond

    def ended(x, r, n, asked, since=()):
        fit = fit_blocks([x], [r], [(np.array([0.0]), np.array([9.0]))], n, since=since)

        def answer(wanted):
            asked.extend(float(point[0][0]) for _, point in wanted)
            return [[left(point[0])] for _, point in wanted]
        return together({0: fit}, answer)[0][0]

    start = np.array([1.4])
    whole, first, second = list[float](), list[float](), list[float]()
    once = ended(start, left(start), 3, whole)
    begun = ended(start, left(start), 1, first)
    assert begun.missed
    gone_on = ended(begun.x, begun.r, 2, second, [begun])
    assert [*first, *second] == whole
    assert gone_on.x == pytest.approx(once.x)


def test_a_move_too_small_to_tell_a_slope_leaves_it_as_it_is():
    low = np.array([1.0 - 1e-170])

    def left(x):
        return np.array([2.0, x[0] - 1.0 + 1e-3])

    fit = fit_blocks([np.array([1.0])], [left([1.0])], [(low, np.array([3.0]))], 6)
    solved = together({0: fit}, lambda wanted: [[left(point[0])] for _, point in wanted])[0][0]
    assert np.isfinite(solved.J).all()


def test_an_interval_is_as_wide_as_stretches_differ_where_their_frames_err_together():
    rng = np.random.default_rng(3)
    stretches = np.repeat(np.arange(40), 50)
    J = -np.ones((2000, 1))
    means = [np.mean(np.repeat(rng.normal(size=40), 50)) for _ in range(200)]  # of what is the same over a stretch
    r = np.repeat(rng.normal(size=40), 50)
    told = np.sqrt(cluster_covariance(Solved(np.zeros(1), r - r.mean(), J), stretches)[0, 0])
    assert told == pytest.approx(np.std(means), rel=0.3)
    white = rng.normal(size=2000)
    variance = cluster_covariance(Solved(np.zeros(1), white, J), stretches)[0, 0]
    assert np.sqrt(variance) == pytest.approx(1 / np.sqrt(2000), rel=0.35)
    assert np.isinf(cluster_covariance(Solved(np.zeros(1), white, np.zeros((2000, 1))), stretches)[0, 0])


def test_what_is_held_feels_no_floor_and_nothing_is_rolled_out_for_it(quiet):
    session, evidence = quiet
    evaluator = RolloutEvaluator(evidence, CONFIG, n_jobs=1)
    plain = evaluator.residuals([RolloutRequest(session.model, (0,))])[0][0]
    floor = replace(session.model, effects=(EffectSpec("ground_friction", (), {"friction": 0.2}),))
    np.testing.assert_array_equal(evaluator.residuals([RolloutRequest(floor, (0,))])[0][0], plain)
    assert evaluator.memory.rollouts == 1
    worn = replace(session.model, effects=(EffectSpec("coulomb_friction", ("three",), {"torque": 0.1}),))
    assert np.nanmax(np.abs(evaluator.residuals([RolloutRequest(worn, (0,))])[0][0] - plain)) > 1
    assert evaluator.memory.rollouts == 2


def test_every_number_of_a_vector_has_its_stretch(quiet):
    _, evidence = quiet
    evaluator = RolloutEvaluator(evidence, CONFIG, n_jobs=1)
    shape = {0: np.zeros_like(evidence[0].recorded)}
    assert len(evaluator.stretches((0,))) == len(evaluator.vector(shape, "fit"))


def test_joints_that_moved_as_the_model_has_it_are_well(quiet):
    session, evidence = quiet
    search = Search(RolloutEvaluator(evidence, CONFIG, n_jobs=1), session.model)
    well, ill = well_on_fixed_base(search, search.evaluate([]))
    assert (well, ill) == (set(session.model.joints), set())


def test_of_one_number_the_lowest_point_of_what_was_seen_is_tried_within_it():
    def seen(*points):
        return [(np.array([x]), y) for x, y in points]

    bounds = np.zeros(1), np.full(1, 9.0)
    assert lowest(seen((0, 9.0), (1, 4.0), (2, 1.0), (4, 1.0), (2, 1.0)), *bounds) == pytest.approx([3.0])
    assert lowest(seen((0, 9.0), (1, 4.0), (2, 1.0)), *bounds) == pytest.approx([2.0])  # not beyond
    assert lowest(seen((0, 0.0), (1, 4.0), (2, 1.0)), *bounds) is None
    assert lowest(seen((0, 1.0), (1, 4.0)), *bounds) is None
    assert lowest([(np.zeros(2), 1.0)] * 3, np.zeros(2), np.ones(2)) is None


def test_numbers_of_a_vector_are_guessed_from_lines_and_parabolas_and_stay_near_what_was_seen():
    c = Candidate.of(known_effects()["ground_tilt"], (), (0.0, 0.0))
    rng = np.random.default_rng(0)
    line, bend, truth = rng.normal(size=(2, 50)), rng.normal(size=(2, 50)), np.array([0.6, -0.9])
    probes = scan(c, (1.0,), True)
    assert [p.tolist() for p in probes] == [[2, 0], [0, 2], [-2, 0], [0, -2], [2, 2], [2, -2], [-2, 2], [-2, -2]]
    both = rng.normal(size=50)

    def shown(x):
        return x @ line + x**2 @ bend + x[0] * x[1] * both

    r0 = -shown(truth)
    seen = [r0 + shown(p) for p in probes]
    x, gain = linearised_estimate(c, r0, probes, seen, SCREENING.far_walking)
    assert x == pytest.approx(truth, abs=1e-3)
    assert gain == pytest.approx(r0 @ r0, rel=1e-6)
    far, _ = linearised_estimate(c, 100 * r0, probes, [100 * r0 + shown(p) for p in probes], SCREENING.far_walking)
    assert np.abs(far).max() <= 4 * SCREENING.far_walking
