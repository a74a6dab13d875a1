"""Effects read directly from the recordings: stops, missed poses, turned marker frames, loose mounts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap_sessions import record_arm
from tests.gap_worn import CONFIG
from workbench.compare.channels import ACROSS
from workbench.compare.compare_session import roll_out, run_of
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes, register_takes
from workbench.effects.registry import known_effects
from workbench.effects.schedules import without_poses
from workbench.identify.conclusions import estimates
from workbench.identify.estimators.dropped_commands import (
    DroppedCommands,
    TakesAsPlayed,
    least_explained,
    poses_lost,
    reestimate,
    stands_at_an_end,
    with_dropped_commands,
)
from workbench.identify.estimators.dropped_in_motion import dropped_in_motion, played_without, suspects
from workbench.identify.estimators.stops_and_mounts import mounts, read_off_candidates, stops
from workbench.identify.fitting.fits import Search
from workbench.identify.options import READ_OFF
from workbench.identify.parameters import Candidate, with_effects
from workbench.identify.preparation import gather
from workbench.identify.results.findings import Change
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.robot import EffectSpec
from workbench.simulation.batch import run_job


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    record_arm(folder)
    session = load_session(folder / "session.yaml")
    takes, _ = read_takes(session)
    rollouts = roll_out([run_of(t) for t in takes], CONFIG, n_jobs=1, floors=False)
    registered, _ = register_takes(session, takes, {t.spec.name: r.nominal for t, r in zip(takes, rollouts)})
    evidence = gather(registered, {t.spec.name: r for t, r in zip(takes, rollouts)})
    return session.model, RolloutEvaluator(evidence, CONFIG, n_jobs=1)


def recorded_with(quiet, model, commands=None):
    """The evaluator's take as another robot, or other commands, would have made it, with the noise that it had."""
    nominal, evaluator = quiet
    e = evaluator.evidence[0]
    noise = e.recorded - e.observe(run_job(evaluator.job(nominal, 0, CONFIG)), nominal)
    job = replace(evaluator.job(model, 0, CONFIG), commands=commands or e.take.commands)
    return evaluator.on([replace(e, recorded=e.observe(run_job(job), model) + noise)])


def nominal_residuals(quiet, evaluator):
    return evaluator.residuals([RolloutRequest(quiet[0], (0,))])[0]


def test_a_quiet_arm_suggests_nothing(quiet):
    residuals = nominal_residuals(quiet, quiet[1])
    assert read_off_candidates(quiet[0], quiet[1].evidence, residuals) == []
    assert with_dropped_commands(quiet[1], quiet[0], residuals)[1] == ()


def test_a_stop_is_read_off_where_the_joint_stands_while_the_model_goes_on(quiet):
    stopped = replace(quiet[0], effects=(EffectSpec("joint_stop", ("two",), {"lower": -180.0, "upper": 18.0}),))
    evaluator = recorded_with(quiet, stopped)
    (found,) = read_off_candidates(quiet[0], evaluator.evidence, nominal_residuals(quiet, evaluator))
    assert found.key == ("joint_stop", ("two",))
    assert found.size == 1
    assert found.values(np.ones(1))[1] == pytest.approx(18.0, abs=0.7)


def test_what_a_joint_passed_elsewhere_is_no_stop(quiet):
    stopped = replace(quiet[0], effects=(EffectSpec("joint_stop", ("two",), {"lower": -180.0, "upper": 18.0}),))
    evidence = [recorded_with(quiet, stopped).evidence[0], quiet[1].evidence[0]]
    residuals = {i: nominal_residuals(quiet, quiet[1].on([e]))[0] for i, e in enumerate(evidence)}
    assert [c.key for c in read_off_candidates(quiet[0], evidence[:1], {0: residuals[0]})] == [("joint_stop", ("two",))]
    assert read_off_candidates(quiet[0], evidence, residuals) == []


def knee(said, seen, base="free"):
    """A take of one joint: angles [deg] of the model and as they were seen."""
    take, s = SimpleNamespace(spec=SimpleNamespace(base=base)), np.array([1e-3])
    e = SimpleNamespace(joints=("knee",), recorded=np.deg2rad(seen)[:, None], sigma=s, zero=lambda joint: 0.0, take=take)
    return e, (e.recorded - np.deg2rad(said)[:, None]) / s


def knee_stops(*takes):
    return stops(known_effects()["joint_stop"], "knee", [e for e, _ in takes], dict(enumerate(r for _, r in takes)))


@pytest.mark.parametrize(("stop", "asked"), [(np.inf, 0), (34.0, 1)], ids=["it turns there", "it stands there"])
def test_a_peak_of_few_frames_is_no_stop(stop, asked):
    peak = np.concatenate([np.arange(30, 40, 2.0), np.arange(40, 28, -2.0)])
    said = np.concatenate([np.zeros(2000), peak, np.zeros(2000)])
    assert len(knee_stops(knee(said, np.minimum(said, stop) + 0.05))) == asked


SWING = 30.0 * np.sin(np.linspace(0.0, 40.0, 2000))


@pytest.mark.parametrize(("base", "further", "asked"), [("free", 0.3, 1), ("free", 0.9, 0), ("fixed", 0.9, 1), ("fixed", 1.8, 0)])
def test_a_stop_is_refuted_by_a_take_that_went_past_it_by_more_than_takes_differ_by(base, further, asked):
    """Takes of another base may be zeroed otherwise."""
    walk, other = knee(SWING, np.minimum(SWING, 20.0)), np.minimum(SWING, 20.0 + further)
    assert len(knee_stops(walk, knee(other, other, base))) == asked


def test_no_fit_moves_a_stop_to_where_recordings_went_past_it():
    (found,) = knee_stops(knee(SWING, np.minimum(SWING, 20.0)))
    lowest = min(found.values(x)[1] for x in found.bounds())
    assert 20.0 - np.rad2deg(READ_OFF.at_stop) - 0.05 < lowest < 20.0


@pytest.mark.parametrize("upper", [18.0, 1.0])
def test_a_stop_stays_where_the_joint_was_seen_to_end(quiet, upper):
    stopped = replace(quiet[0], effects=(EffectSpec("joint_stop", ("two",), {"lower": -180.0, "upper": upper}),))
    evaluator = recorded_with(quiet, stopped)
    (found,) = read_off_candidates(quiet[0], evaluator.evidence, nominal_residuals(quiet, evaluator))
    least, most = sorted(found.values(x)[1] for x in found.bounds())
    lowest = min(np.rad2deg(np.nanmin(e.recorded[:, e.joints.index("two")] + e.zero("two"))) for e in evaluator.evidence)
    assert lowest < least < upper < most
    for x in found.bounds():  # each can be built
        evaluator.residuals([RolloutRequest(with_effects(quiet[0], [(found, x)]), (0,))])


def test_a_loose_mount_is_read_off_with_its_axis(quiet):
    loose = replace(quiet[0], effects=(EffectSpec("loose_mount", ("two",), {"play": 6.0, "axis": (1.0, 0.0, 0.0)}),))
    evaluator = recorded_with(quiet, loose)
    found = [
        c
        for c in read_off_candidates(quiet[0], evaluator.evidence, nominal_residuals(quiet, evaluator))
        if c.name == "loose_mount"
    ]
    assert [c.where for c in found] == [("two",)]
    assert np.abs(found[0].values(np.ones(1))[1:]) == pytest.approx([1, 0, 0], abs=0.04)


def rocking(nominal, *centres):
    """The loose mount that is read off an arm that rocks by 6 deg across its joint two, in takes zeroed at such places [deg]."""
    axis = nominal.kinematics.frames["two"].axis_of_parent
    across = "xyz"[int(np.argmin(np.abs(axis)))]
    channels = ("two", *(f"two{ACROSS}{a}" for a in "xyz" if abs(axis["xyz".index(a)]) < 0.5))
    rng, takes, residuals = np.random.default_rng(0), [], {}
    for i, centre in enumerate(centres):
        angles = np.zeros((800, 3))
        angles[:, channels.index(f"two{ACROSS}{across}")] = centre + np.clip(6 * np.sin(np.arange(800) / 30), -3, 3)
        angles = np.deg2rad(angles + rng.normal(0, 0.17, angles.shape))
        sigma = np.full(3, np.deg2rad(0.17))
        takes.append(SimpleNamespace(channels=channels, recorded=angles, sigma=sigma))
        residuals[i] = angles / sigma
    ill = [dict.fromkeys(channels[1:], 5.0)] * len(centres)
    return mounts(known_effects()["loose_mount"], "two", nominal, takes, residuals, ill)[0]


@pytest.mark.parametrize("centres", [(0.0,), (-3.0, 3.0)], ids=["one take", "takes zeroed at either end"])
def test_a_loose_mount_has_the_play_by_which_cameras_saw_it_rock(quiet, centres):
    found = rocking(quiet[0], *centres)
    assert found.size == 0
    assert found.values(np.empty(0))[0] == pytest.approx(6.0, abs=0.25)
    told = estimates(found, np.empty(0), np.empty((0, 0)))
    assert told["play"].low < 6.0 < told["play"].high
    assert told["axis"].low == (-np.inf,) * 3


def test_missed_poses_are_read_off_and_what_was_missed_is_played_so(quiet):
    commands = quiet[1].evidence[0].take.commands
    goals, c = commands.goals.copy(), commands.column("one")
    goals[1, c] = goals[0, c]
    evaluator = recorded_with(quiet, quiet[0], replace(commands, goals=goals))
    before, sent = nominal_residuals(quiet, evaluator), evaluator
    evaluator, (missed,) = with_dropped_commands(evaluator, quiet[0], before)
    again = TakesAsPlayed(sent, (missed,)).as_found()
    np.testing.assert_array_equal(again.evidence[0].take.commands.goals, evaluator.evidence[0].take.commands.goals)
    np.testing.assert_array_equal(sent.evidence[0].take.commands.goals, commands.goals)
    assert (missed.joint, missed.count, missed.of) == ("one", 1, len(commands.times))
    finding = missed.finding()
    share = finding.parameters["probability"]
    assert share.low < share.value < share.high
    after = nominal_residuals(quiet, evaluator)
    assert np.nansum(np.square(after[0])) < 0.2 * np.nansum(np.square(before[0]))


def test_what_was_taken_for_missed_is_read_anew_from_what_fixed_base_takes_identified(quiet):
    slow = Candidate.of(known_effects()["command_delay"], ("one",), (0.0,))
    x = np.array([6.0])
    evaluator = recorded_with(quiet, with_effects(quiet[0], [(slow, x)]))
    wrong = DroppedCommands("dropped_command", "one", {0: (1,)}, 4, Change(2.0, 1.0, "deg"), Change(2.0, 1.0, "deg"))
    search = Search(played_without(evaluator, {(0, "one"): (1,)}), quiet[0])
    current = search.evaluate([(slow, x)])
    search, played = reestimate(search, current, TakesAsPlayed(evaluator, (wrong,)))
    assert played.missed == ()
    assert search.evaluator.cost(search.evaluate([(slow, x)]).residuals, "fit") < 0.2 * current.cost["fit"]
    assert search.evaluator.evidence[0].take.commands is evaluator.evidence[0].take.commands


def quick_session(quiet, lost):
    """The evaluator of the arm moved on before it comes to rest, recorded without some poses of joint one."""
    e = quiet[1].evidence[0]
    times = np.arange(0.0, e.take.commands.end - 0.1, 0.15)
    swing = np.deg2rad(np.tile([18.0, 6.0, -9.0, -9.0, 15.0], 40)[:len(times)])
    first = np.zeros(len(times), dtype=int)
    quick = replace(e.take.commands, times=times, goals=np.outer(swing, np.ones(len(e.take.commands.joints))),
                    speeds=e.take.commands.speeds[first], enabled=e.take.commands.enabled[first],
                    poses=e.take.commands.poses[first])
    played = without_poses(quick, quick.column("one"), lost)
    there = recorded_with(quiet, quiet[0], played)
    return there.on([replace(there.evidence[0], take=replace(e.take, commands=quick))])


def test_what_comes_after_a_missed_pose_is_judged_beside_a_robot_that_missed_it_too(quiet):
    """On its way to the next, which comes soon after, the joint has gone as little as if it had missed that one, too."""
    e = quick_session(quiet, ()).evidence[0]
    commands = e.take.commands
    times = np.array([0.0, 0.6, 0.95, 1.1, 1.7])
    goals = np.outer(np.deg2rad([18.0, 5.0, -20.0, 18.0, 0.0]), np.ones(len(commands.joints)))
    first = np.zeros(len(times), dtype=int)
    slow = replace(commands, times=times, goals=goals, speeds=np.full(goals.shape, np.deg2rad(60.0)),
                   enabled=commands.enabled[first], poses=commands.poses[first])
    evaluator = recorded_with(quiet, quiet[0], without_poses(slow, slow.column("one"), (1, 4)))
    evaluator = evaluator.on([replace(evaluator.evidence[0], take=replace(e.take, commands=slow))])
    (missed,) = with_dropped_commands(evaluator, quiet[0], nominal_residuals(quiet, evaluator))[1]
    assert (missed.poses, missed.of) == ({0: (1, 4)}, 5)


@pytest.mark.parametrize("lost", [(), (2,), (2, 6, 7)])
def test_poses_missed_on_the_way_are_those_without_which_the_joint_goes_so(quiet, lost):
    evaluator = quick_session(quiet, lost)
    found = dropped_in_motion(evaluator, quiet[0], nominal_residuals(quiet, evaluator))
    assert found == ({(0, "one"): lost} if lost else {})


def test_of_poses_in_a_row_that_may_be_missed_the_first_is_asked_alone(quiet):
    """The cameras saw nothing until the next pose came, as a joint stayed behind: together neither pose would be believed."""
    e = quick_session(quiet, ()).evidence[0]
    time, times = e.take.recorded.since_start, e.take.commands.times
    residual = np.zeros_like(e.recorded)
    residual[(time > times[6] - 0.05) & (time < times[7])] = np.nan
    residual[time > times[7] + 0.03, e.joints.index("one")] = 20.0  # poses 6 and 7 go down
    assert suspects(quiet[1].on([e]), {0: residual}, {}, set()) == {(0, "one"): (6,)}
    assert suspects(quiet[1].on([e]), {0: residual}, {}, {(0, "one", 6)}) == {(0, "one"): (7,)}


def test_a_joint_that_stands_at_its_end_missed_no_pose(quiet):
    stopped = replace(quiet[0], effects=(EffectSpec("joint_stop", ("two",), {"lower": -180.0, "upper": 6.0}),))
    evaluator = recorded_with(quiet, stopped)
    kept = poses_lost(evaluator, quiet[0], "two", {0: ()}, nominal_residuals(quiet, evaluator))[0][0]
    assert len(kept) == 2
    assert stands_at_an_end(evaluator.evidence, "two", {0: kept})
    commands = quiet[1].evidence[0].take.commands
    goals, c = commands.goals.copy(), commands.column("one")
    goals[1, c] = goals[0, c]
    evaluator = recorded_with(quiet, quiet[0], replace(commands, goals=goals))
    ((lost,),) = poses_lost(evaluator, quiet[0], "one", {0: ()}, nominal_residuals(quiet, evaluator))[0].values()
    assert not stands_at_an_end(evaluator.evidence, "one", {0: (lost,)})


def test_where_a_link_lay_in_its_play_when_it_was_zeroed_is_left_open_within_the_play(quiet):
    loose = replace(quiet[0], effects=(EffectSpec("backlash", ("two",), {"gap": 4.0}),))
    evaluator = recorded_with(quiet, loose)
    (e,) = evaluator.evidence
    column = e.channels.index("two")

    def left(turned, model):
        recorded = e.recorded.copy()
        recorded[:, column] += np.deg2rad(turned)
        residuals = evaluator.on([replace(e, recorded=recorded)]).residuals([RolloutRequest(model, (0,))])[0][0]
        return float(np.nanmean(residuals[:, column] * e.sigma[column]))

    assert left(1.5, loose) == pytest.approx(left(0.0, loose), abs=np.deg2rad(0.05))
    assert left(9.0, loose) > np.deg2rad(4.0)
    assert left(1.5, quiet[0]) - left(0.0, quiet[0]) > np.deg2rad(1.0)


def test_poses_missed_on_the_ground_alone_must_explain_nearly_all():
    def evaluator(*bases):
        return SimpleNamespace(evidence=[SimpleNamespace(take=SimpleNamespace(spec=SimpleNamespace(base=b))) for b in bases])

    assert least_explained(evaluator("fixed", "free"), {0: 1, 1: 0}) == READ_OFF.dropped_explains
    assert least_explained(evaluator("fixed", "free"), {0: 0, 1: 2}) == READ_OFF.dropped_explains_free
    assert least_explained(evaluator("free", "free"), {0: 1, 1: 1}) == READ_OFF.dropped_explains
    assert least_explained(evaluator("fixed", "free"), {0: 0, 1: 1}) is None
