"""Of long recordings a search looks at a share."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.arm import arm, goals, measured, played
from benchmarks.arm import session as log_session
from tests.gap_sessions import record_arm, session_content, write_session
from workbench.compare.compare_session import roll_out, run_of
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes, register_takes
from workbench.identify import subset as share
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.options import PROBLEM
from workbench.identify.preparation import gather, prepare
from workbench.identify.problem import part_of
from workbench.identify.rollouts import servo_logs
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.identify.rollouts.servo_logs import most_together
from workbench.identify.subset import at_most, data_subset, floors_everywhere, rebalance, subset_used
from workbench.robot import EffectSpec
from workbench.simulation import SimulationConfig

CONFIG = SimulationConfig(settle=0.6, contact_period=0, time_step=2e-3)


def write_two_takes(folder, use=None):
    """One with a stiff joint, one without."""
    for k, (name, friction) in enumerate((("worn", 0.16), ("well", 0.06))):
        record_arm(folder, name, friction, seed=k)
    wave = session_content()["takes"][0]
    takes = [wave | {"name": n, "recording": f"takes/{n}.csv"} | ({"use": use[n]} if use else {}) for n in ("worn", "well")]
    return load_session(write_session(folder, session_content() | {"takes": takes}))


def evidence_of(session):
    takes, _ = read_takes(session)
    rollouts = {t.spec.name: r for t, r in zip(takes, roll_out([run_of(t) for t in takes], CONFIG, n_jobs=1))}
    registered, _ = register_takes(session, takes, {n: r.nominal for n, r in rollouts.items()})
    return gather(registered, rollouts)


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    session = write_two_takes(tmp_path_factory.mktemp("two"))
    evidence = evidence_of(session)
    evaluator = RolloutEvaluator(evidence, CONFIG, n_jobs=1)
    return session.model, evaluator, evaluator.residuals([RolloutRequest(session.model, (0, 1))])[0]


@pytest.fixture
def shorter(monkeypatch):
    """What counts as long."""
    monkeypatch.setattr(share, "PROBLEM", replace(PROBLEM, long=3.0, looked_at=1.7, piece=0.8))


def test_short_sessions_are_looked_at_whole(two):
    _, evaluator, residuals = two
    assert data_subset(evaluator.evidence, residuals) == list(evaluator.evidence)
    assert subset_used(evaluator.evidence) == {}


def test_what_is_looked_at_is_where_most_is_missing_and_no_more_than_asked(two, shorter):
    _, evaluator, residuals = two
    worn, well = data_subset(evaluator.evidence, residuals)
    assert 0.8 <= worn.until <= 1.7
    assert worn.until + well.until <= 1.7 + 1e-6
    assert subset_used([worn, well])["searched"]["worn"] == pytest.approx(worn.until, abs=0.05)
    assert not any(mask[worn.since > worn.until].any() for mask in worn.uses.values())
    assert worn.uses["fit"].any()
    assert worn.uses["choose"].any()


def test_a_take_that_is_not_looked_at_costs_nothing_and_one_that_is_ends_early(two):
    model, evaluator, residuals = two
    early, never = (e.looked_at(until) for e, until in zip(evaluator.evidence, (1.0, 0.0)))
    other, before = evaluator.on([early, never]), evaluator.memory.rollouts
    told = other.residuals([RolloutRequest(model, (0, 1))])[0]
    assert other.memory.rollouts - before == 1
    assert np.isnan(told[1]).all()
    assert np.isnan(told[0][early.since > 1.0]).all()
    well_before = early.moving & (early.since < 0.9)
    # the start shifts by what may be seen, which is less
    np.testing.assert_allclose(told[0][well_before], residuals[0][:len(early.since)][well_before], atol=0.1)
    floors = floors_everywhere([early, never], {0: np.ones(len(early.channels)), 1: np.zeros(len(never.channels))})
    np.testing.assert_allclose(floors[1] * never.sigma, early.sigma)


LATE, FAST, LOSING = (EffectSpec(name, (), numbers) for name, numbers in (
    ("command_delay", {"delay": 0.05}), ("clock_rate", {"ratio": 0.55}), ("timing_drift", {"per_pose": -0.02})))


@pytest.mark.parametrize("effects", [(), (LATE,), (FAST,), (LOSING, LATE)])
@pytest.mark.parametrize("until", [1.2, 0.3])
def test_a_take_is_cropped_to_what_is_looked_at_and_says_the_same_to_the_bit(two, until, effects):
    model, evaluator, _ = two
    model = model.with_effects(effects)
    e = evaluator.evidence[0]
    cropped = e.looked_at(until)
    assert cropped.since[-1] < until + PROBLEM.late + 3 * e.frame_time < e.since[-1]
    assert len(cropped.take.recorded.q) == len(cropped.recorded) == len(cropped.offset) == len(cropped.uses["fit"])
    assert (len(cropped.take.commands.times) < len(e.take.commands.times)) is (until < 0.5)
    whole = replace(e, until=until, uses={use: mask & (e.since <= until) for use, mask in e.uses.items()})
    left = [evaluator.on([of]).residuals([RolloutRequest(model, (0,))])[0][0] for of in (cropped, whole)]
    np.testing.assert_array_equal(left[0], left[1][:len(left[0])])
    assert np.isfinite(left[0]).any()
    assert not np.isfinite(left[1][len(left[0]):]).any()


def test_a_cropped_take_is_played_by_the_beginning_of_other_commands(two):
    whole, cropped = (two[1].evidence[0], two[1].evidence[0].looked_at(0.3))
    other = replace(whole.take.commands, goals=-whole.take.commands.goals)
    kept = len(cropped.take.commands.times)
    assert 0 < kept < len(other.times)
    np.testing.assert_array_equal(cropped.played(other).take.commands.goals, other.goals[:kept])
    assert whole.played(other).take.commands is other
    assert cropped.played(None).take.commands is None


@pytest.mark.parametrize("long", [1.0, 60.0])
def test_takes_that_validate_are_not_looked_at(tmp_path, monkeypatch, long):
    monkeypatch.setattr(share, "PROBLEM", replace(share.PROBLEM, long=long))
    session = write_two_takes(tmp_path, {"worn": "fit", "well": "validate"})
    evidence = evidence_of(session)
    residuals = RolloutEvaluator(evidence, CONFIG, n_jobs=1).residuals([RolloutRequest(session.model, (0, 1))])[0]
    looked_at = data_subset(evidence, residuals)
    assert [e.until > 0 for e in looked_at] == [True, False]
    assert ("searched" in subset_used(looked_at)) is (long < 60)


def test_a_stiff_joint_is_named_from_a_share_and_judged_on_all(tmp_path, shorter, monkeypatch):
    monkeypatch.setattr(share, "PROBLEM", replace(share.PROBLEM, looked_at=3.0))
    for k, name in enumerate(("wave", "again")):
        record_arm(tmp_path, name, 0.16, seed=k)
    wave = session_content()["takes"][0]
    takes = [wave | {"name": n, "recording": f"takes/{n}.csv"} for n in ("wave", "again")]
    told = diagnose_session(load_session(write_session(tmp_path, session_content() | {"takes": takes})), n_jobs=1)
    found, = told.diagnosis.findings
    assert (found.effect, found.where) == ("coulomb_friction", ("three",))
    assert told.diagnosis.verdict == "explained"
    assert sum(told.diagnosis.provenance["searched"].values()) <= 3.0
    for take in told.takes:  # of both takes, all is judged
        assert np.isfinite(take.after[take.time > 2.0]).any()
        assert max(take.ratios(take.after).values()) < 1.6


def test_another_third_of_the_frames_judges_what_the_usual_one_hardly_shows(two):
    """A joint met its stop but twice, while the frames that judge looked away."""
    _, evaluator, residuals = two
    e = evaluator.evidence[0]
    k = e.channels.index("three")
    part = part_of(e.since)

    def judging(third):
        met = residuals[0].copy()
        met[:, k] = np.where(e.moving & (third == part), 40.0, 0.1)
        (seen, _) = rebalance(evaluator.evidence, {0: met, 1: residuals[1]})
        assert (seen.uses["validate"] == e.uses["validate"]).all()
        assert not (seen.uses["fit"] & seen.uses["choose"]).any()
        assert ((seen.uses["fit"] | seen.uses["choose"]) == (e.uses["fit"] | e.uses["choose"])).all()
        return set(part[seen.uses["choose"]].tolist())

    assert judging(0) == {0}
    assert judging(2) == {2}
    assert judging(PROBLEM.deciding_part) == {PROBLEM.deciding_part}
    assert rebalance(evaluator.evidence, residuals) == list(evaluator.evidence)
    assert rebalance(evaluator.evidence, {i: 0.1 * np.ones_like(r) for i, r in residuals.items()}) == list(evaluator.evidence)


def test_the_last_fit_uses_all_of_short_sessions_and_the_beginnings_of_long_ones(two):
    _, evaluator, _ = two
    evidence = list(evaluator.evidence)
    whole = sum(float(e.since[-1]) for e in evidence)
    assert at_most(evidence, whole + 0.1) == evidence
    shorter = at_most(evidence, 2.0)
    assert [e.until for e in shorter] == pytest.approx([1.0, 1.0])
    assert all(len(e.recorded) < len(w.recorded) and not (e.uses["fit"] & (e.since > e.until)).any()
               for e, w in zip(shorter, evidence))
    judging = replace(evidence[1], uses=dict.fromkeys(evidence[1].uses, np.zeros(len(evidence[1].recorded), dtype=bool)))
    assert [e.until for e in at_most([evidence[0], judging], 2.0)] == pytest.approx([2.0, 0.0])


def test_commands_of_a_log_are_put_in_the_models_order_once(tmp_path, monkeypatch):
    """Results derived from commands are cached by object."""
    model, told = arm(tmp_path), goals(1.0)
    takes, _ = read_takes(log_session(tmp_path, measured(told, played(model, told, ()), seed=1)))
    (e,) = prepare(load_session(tmp_path / "session.yaml"), takes, CONFIG, 1, lambda what, done: None).evidence
    other = e.played(e.take.commands.reordered(model.joints[::-1]))
    jobs = []
    monkeypatch.setattr(servo_logs, "servo_angles", lambda models: jobs.extend(m[0] for m in models) or [[] for _ in models])
    servo_logs.log_angles([other], CONFIG, [(RolloutRequest(model, (0,)), (0,))] * 2)
    first, second = jobs
    assert first.commands is second.commands
    assert first.commands.joints == model.joints


def test_of_a_logs_nominal_rollout_only_the_rows_of_the_log_are_kept(tmp_path):
    model, told = arm(tmp_path), goals(1.0)
    session = log_session(tmp_path, measured(told, played(model, told, ()), seed=1))
    takes, _ = read_takes(session)
    seen = prepare(session, takes, CONFIG, 1, lambda what, done: None)
    (kept,), (e,) = seen.nominal.values(), seen.evidence
    (whole,) = roll_out([run_of(t) for t in takes], CONFIG, n_jobs=1, floors=False)
    assert len(kept) == len(e.take.recorded) < len(whole.nominal)
    asked = [(RolloutRequest(model, (0,), step), (0,)) for step in (1.0, 0.5)]
    assert most_together([e], CONFIG, asked) == PROBLEM.together
    fine = most_together([e], replace(CONFIG, time_step=2e-6, log_period=2e-6), asked)  # 3 joints, half a million rows
    assert 1 <= fine < PROBLEM.together
    assert fine * 8 * 3 * 1.0 / 2e-6 <= PROBLEM.played << 20
    shown, usual = e.take.observe(kept), e.take.observe(whole.nominal)
    np.testing.assert_array_equal(shown.time, usual.time)
    np.testing.assert_array_equal(shown.q, usual.q)
