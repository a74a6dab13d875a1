"""The search: deterministic, resumes after it was killed, keeps limits by rank, and says what binds."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tests.command import refused
from workbench.files import InputError
from workbench.gait.certify import CertifyOptions
from workbench.gait.ensemble import Ensemble, load_ensemble
from workbench.gait.evaluate import Evaluator
from workbench.gait.feasibility import STANDING, out_of_reach
from workbench.gait.finalists import Screening, finalists
from workbench.gait.limits import GaitLimits, binding
from workbench.gait.machine import GaitMachine
from workbench.gait.optimize import OptimizeOptions, optimize, options_of
from workbench.gait.refine import RefineOptions
from workbench.gait.request import Request
from workbench.gait.requirements import drift
from workbench.gait.search import Budget, Found, search, steer
from workbench.gait.shape import GaitShape
from workbench.gait.space import seeds, space_of
from workbench.gait.table import paths_of
from workbench.robot import EffectSpec, data_file, puppy_model
from workbench.robot.model_file import Posterior

SMALL = Budget(seeds=6, screened=2, starts=1, population=4, generations=1, draws=1)


@pytest.fixture(scope="module")
def machine():
    return GaitMachine(puppy_model())


def quiet(what, done):
    pass


def test_killed_and_started_again_it_ends_in_the_same_table(machine, tmp_path):
    draws = load_ensemble().draws(machine.model, 1, 0, tmp_path)
    memory = tmp_path / "search.jsonl"
    whole = search(Evaluator(machine, Request(), draws, memory), SMALL, 3, quiet)
    lines = memory.read_text().splitlines(keepends=True)
    memory.write_text("".join(lines[:4]) + lines[4][:30])  # killed while it wrote the fifth
    again = Evaluator(machine, Request(), draws, memory)
    resumed = search(again, SMALL, 3, quiet)
    assert resumed.best.shape == whole.best.shape
    assert 0 < again.rollouts < whole.rollouts
    np.testing.assert_array_equal(resumed.best.table.cycle.goals, whole.best.table.cycle.goals)


def test_seeds_are_of_every_family_and_of_the_request(machine):
    request = Request("backward")
    found = seeds(machine, request, space_of(machine, request), 60, 0)
    assert {s.family for s in found} == {"trot", "walk", "crawl", "bound", "pace"}
    assert len({s.knees for s in found}) == 4
    assert all(s.stride < 0 for s in found)
    assert found == seeds(machine, request, space_of(machine, request), 60, 0)
    assert {s.knees for s in seeds(machine, replace(request, built_knees=True), space_of(machine, request), 20, 0)} == {(1, 1)}
    for s in found[:5]:
        space = space_of(machine, request)
        assert space.shape(space.point(s), s.family, s.knees) == pytest.approx(s)


def test_a_gait_that_breaks_a_limit_comes_after_all_that_keep_them(machine):
    evaluator = Evaluator(machine, Request(), [])
    shapes = seeds(machine, Request(), space_of(machine, Request()), 8, 1)
    judged = sorted(evaluator.judge(shapes, 0), key=lambda c: c.rank())
    good = [c.good for c in judged]
    assert good == sorted(good, reverse=True)
    broken = [c.merit for c in judged if not c.good]
    assert broken == sorted(broken)
    assert all(c.merit >= c.cost + c.violation for c in judged if np.isfinite(c.cost))


def test_what_no_gait_can_do_is_told_with_the_limit_that_binds_and_what_works(machine, capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("workbench.gait.optimize.FIRST_LOOK", replace(SMALL, seeds=24, draws=0))
    monkeypatch.setattr("workbench.gait.optimize.BRIEFLY", CertifyOptions(draws=0, checked=0, seconds=1.0, floor_seconds=0.3))
    assert out_of_reach(machine, Request(speed=0.3)) is None
    assert out_of_reach(machine, Request(speed=3.0)).name == "foot speed"
    assert out_of_reach(machine, Request(slope=np.radians(30))).name == "slope"
    result = optimize(machine, Request(slope=np.radians(30)), Ensemble(), OptimizeOptions(), quiet)
    assert not result.met
    assert "slope, friction 0.5: 30 of 26.6 deg" in result.problem
    brief = replace(options_of(1).certify, step=2e-3, variants=("2 ms",))
    lax = replace(Request().limits, drift=50.0, aside=50.0, slip=5.0, lift=1e-6, rms=1.3, torque=2.0)
    result = optimize(machine, Request(speed=3.0, limits=lax), Ensemble(), OptimizeOptions(SMALL, brief, planned=False), quiet)
    assert "cannot be met by any gait: foot speed" in result.problem
    assert "the nearest table in a quick search reaches" in result.problem
    assert result.table is not None
    said = refused(capsys, "optimize", "--slope", "30", "--out", str(tmp_path / "out"))
    assert "slope, friction 0.5" in said


def test_a_gait_that_turns_is_steered_straight(machine):
    request = Request()
    space, evaluator = space_of(machine, request), Evaluator(machine, request, [])
    trot = GaitShape("trot", (1, 1), 8, 2.2, stride=0.06, duty=0.6, lift=0.02, crouch=0.04, lead=1.0)
    (crooked,) = evaluator.judge([replace(trot, turn=0.05)], 0)
    (straight,) = steer(evaluator, space, [crooked])
    assert abs(drift(request, crooked.nominal)) > request.limits.drift
    assert abs(drift(request, straight.nominal)) < abs(drift(request, crooked.nominal)) / 3


def test_every_gait_that_counts_was_tried_on_the_ensemble_from_the_first_generation(machine, tmp_path):
    draws = load_ensemble().draws(machine.model, 2, 0, tmp_path)
    seen = []

    class Watched(Evaluator):
        def judge(self, shapes, count, keep=None):
            out = super().judge(shapes, count, keep)
            seen.append(count)
            return out

    found = search(Watched(machine, Request(), draws), replace(SMALL, draws=2), 1, quiet)
    assert seen.count(2) == 2  # the best seeds, and the better part of the one generation
    assert len(found.best.draws) == 2
    assert all(len(c.draws) == 2 for c in found.others)


def test_a_search_begins_at_the_gait_it_is_given(machine):
    start = GaitShape("trot", (1, 1), 8, 2.2, stride=0.06, duty=0.6, lift=0.02, crouch=0.04, lead=1.0)
    evaluator = Evaluator(machine, Request(), [])
    one = replace(SMALL, seeds=0, draws=0, generations=1)
    found = search(evaluator, one, 1, quiet, (start,))
    (walked,) = steer(evaluator, space_of(machine, Request()), evaluator.judge([start], 0))
    assert (found.best.shape.family, found.best.shape.knees) == ("trot", (1, 1))
    assert found.best.rank() <= walked.rank()
    with pytest.raises(InputError, match="a gait to start from"):
        search(evaluator, one, 1, quiet)


def test_every_seed_is_within_reach_and_ranges(machine):
    space = space_of(machine, Request())
    for paths in paths_of(machine, seeds(machine, Request(), space, 12, 2)):
        assert paths.off.max() <= Request().limits.reach
        assert np.degrees(np.abs(paths.q)).max() < 120


def test_a_search_that_is_far_from_the_speed_asked_for_ends_halfway(machine):
    found = search(Evaluator(machine, Request(speed=1.9), []), replace(SMALL, draws=0, generations=5), 3, quiet)
    assert found.generations == 4


def test_a_request_that_is_not_met_names_the_nearest_table(machine, tmp_path):
    brief = replace(options_of(1).certify, draws=0, seconds=1.0, floor_seconds=0.3, step=2e-3, variants=("2 ms",))
    options = OptimizeOptions(replace(SMALL, draws=0), brief, planned=False, refine=RefineOptions(iterations=0))
    request = Request(speed=0.6)
    lax = replace(request.limits, drift=50.0, aside=50.0, slip=5.0, lift=1e-6)
    result = optimize(machine, replace(request, limits=lax), Ensemble(), options, quiet)
    assert not result.met
    assert "not met" in result.problem
    assert "the nearest table that keeps every limit reaches" in result.problem
    assert result.table is not None
    assert not result.certified.certificate.kept


def test_finalists_are_tried_one_after_the_other_on_fresh_robots_until_one_holds(machine, tmp_path):
    """The best gait of the search is too slow in the longer walk of the certificate; the next one is fast enough."""
    fresh = load_ensemble().draws(machine.model, 3, 9, tmp_path)
    limits = replace(Request().limits, drift=10.0, aside=10.0, tilt=3.0, slip=50.0, lift=1e-6, spread=100.0)
    lax = Request(limits=limits)
    slow, fast = (GaitShape("trot", (1, 1), 8, 2.2, stride=stride, duty=0.6, lift=0.02, crouch=0.04, lead=1.0)
                  for stride in (0.02, 0.06))
    brief = replace(CertifyOptions(), seconds=1.0, draw_seconds=1.0, step=2e-3)
    begun = Evaluator(machine, lax, []).judge([slow, fast], 0)
    found = Found(begun[0], None, 1, 2, (begun[1],))
    between = 0.5 * sum(c.nominal.speed for c in begun)
    first, second = finalists(machine, replace(lax, speed=between), found, fresh, Screening((1, 3)), brief, None, 1, quiet)
    assert not first.good
    assert first.draws == ()  # too slow on the nominal robot: it meets no others
    assert second.shape == fast
    assert len(second.draws) == 3
    assert {m.name for m in second.margins} >= {"tilt", "tilt over draws", "slip over draws", "speed of the worse half of draws"}
    hurried = replace(lax, limits=replace(limits, back=0.1))
    alone = replace(found, best=begun[1], others=())
    (early,) = finalists(machine, hurried, alone, fresh, Screening((1, 3)), brief, None, 1, quiet)
    assert not early.good
    assert early.draws == ()  # not back in its cycle soon enough: it meets no others
    assert binding(early.margins).name == "way back to its cycle"


def test_the_bundled_ensemble_draws_what_it_says(machine, tmp_path):
    ensemble = load_ensemble()
    draws = ensemble.draws(machine.model, 6, 5, tmp_path)
    assert [d.sha256 for d in draws] == [d.sha256 for d in ensemble.draws(machine.model, 6, 5, tmp_path)]
    assert len({d.sha256 for d in draws}) == 6
    values = {name: [e.parameters for d in draws for e in d.effects if e.effect == name] for name in (
        "ground_friction", "supply_voltage", "command_delay", "backlash", "zero_offset", "payload", "supply_sag")}
    assert all(0.3 <= p["friction"] <= 0.9 for p in values["ground_friction"])
    assert all(0.017 <= p["delay"] <= 0.05 for p in values["command_delay"])
    assert len(values["command_delay"]) == 6 * 15
    assert len(values["backlash"]) == len(values["zero_offset"]) == 6 * 12
    masses = np.array([[d.kinematics.masses[link] / m for link, m in machine.model.kinematics.masses.items()] for d in draws])
    assert 0.85 <= masses.min() < 0.95 < 1.05 < masses.max() <= 1.15


def test_a_diagnosed_models_posterior_is_drawn(machine, tmp_path):
    model = machine.model.with_effect(EffectSpec("backlash", ("flm",), {"gap": 3.0}))
    posterior = Posterior(("backlash(flm).gap",), np.array([3.0]), np.array([[0.04]]))
    draws = load_ensemble(posterior=posterior).draws(model, 30, 1, tmp_path)
    played = [(e.where, e.parameters["gap"]) for d in draws for e in d.effects if e.effect == "backlash"]
    gaps = [gap for where, gap in played if where == ("flm",)]
    assert len(gaps) == 30  # what the diagnosis found replaces the file's play in this joint
    assert len(played) == 30 * 12  # and in no other
    assert all(gap <= 1.0 for where, gap in played if where != ("flm",))
    assert np.mean(gaps) == pytest.approx(3.0, abs=0.15)
    assert 0.1 < np.std(gaps) < 0.3


def test_less_friction_than_nominal_is_drawn_down_to_none(machine, tmp_path):
    nominal = machine.model.servo("flm").coulomb_friction
    model = machine.model.with_effect(EffectSpec("coulomb_friction", ("flm",), {"torque": -0.8 * nominal}))
    posterior = Posterior(("coulomb_friction(flm).torque",), np.array([-0.8 * nominal]), np.array([[(0.3 * nominal)**2]]))
    draws = load_ensemble(posterior=posterior).draws(model, 30, 1, tmp_path)
    torques = [e.parameters["torque"] for d in draws for e in d.effects if e.effect == "coulomb_friction"]
    assert len(torques) == 30
    assert min(torques) == -nominal
    assert max(torques) < 0.0
    assert -nominal < np.median(torques) < -0.5 * nominal


@pytest.mark.parametrize(("text", "said"), [
    ("format: 2", "format: expected 1"), ("format: 1\nfriction: {low: 0.5}", "friction.high: is missing"),
    ("format: 1\nfriction: {low: 0.5, high: 0.1}", "friction.high: expected at least 0.5"),
    ("format: 1\nwind: 3", "wind: unknown key"),
    ("format: 1\nlink_mass: {share: 2}", "link_mass.share: expected a number of at least 0 and at most 0.9"),
    ("format: 1\npayload: {mass: 100}", "payload.mass: expected a number of at least 0 and at most 5, got 100")])
def test_a_bad_ensemble_file_is_one_line(tmp_path, text, said):
    path = tmp_path / "e.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        load_ensemble(path)


def test_the_bundled_file_is_the_default():
    assert load_ensemble().sha256 == load_ensemble(data_file("gait_ensemble.yaml")).sha256
    assert json.dumps(sorted(load_ensemble().ranges)) == json.dumps(
        ["backlash", "command_delay", "friction", "supply_sag", "supply_voltage"])


@pytest.mark.parametrize(("way", "shape"), [
    ("turn", GaitShape("trot", (1, 1), 8, 2.0, turn=0.2, lift=0.02, crouch=0.04)),
    ("sideways", GaitShape("trot", (1, 1), 8, 2.0, side=0.03, lift=0.02, crouch=0.04))])
def test_what_goes_to_the_right_mirrors_what_goes_to_the_left(machine, way, shape):
    left, right = Request(way), Request(way, right=True)
    mirrored = replace(shape, turn=-shape.turn, side=-shape.side)
    (a,), (b,) = (Evaluator(machine, r, [], seconds=1.0).judge([s], 0) for r, s in ((left, shape), (right, mirrored)))
    assert left.progress(a.nominal) > 0
    assert right.progress(b.nominal) == pytest.approx(left.progress(a.nominal), rel=0.15)
    assert right.progress(a.nominal) < 0
    space = space_of(machine, right)
    assert all(getattr(s, {"turn": "turn", "sideways": "side"}[way]) < 0 for s in seeds(machine, right, space, 4, 0))


def test_an_arc_to_the_right_has_its_curvature_judged_to_the_right(machine):
    request = Request("arc", radius=0.5, right=True)
    (walked,) = Evaluator(machine, request, [], seconds=1.0).judge(
        [GaitShape("trot", (1, 1), 8, 2.2, stride=0.05, turn=-0.1, lift=0.02, crouch=0.04, lead=1.0)], 0)
    bend = {m.name: m.value for m in walked.margins}["curvature off the arc"]
    assert bend == pytest.approx(abs(-walked.nominal.turn_rate * 0.5 / walked.nominal.speed - 1))
    assert bend < 1.0


@pytest.mark.parametrize(("request_", "binds"), [
    (Request("arc", speed=0.3, radius=0.05), "speed of a joint on its foot's path"),
    (Request(speed=0.1, limits=GaitLimits(rms=0.001)), STANDING), (Request(slope=-np.radians(30)), "slope")])
def test_what_is_impossible_is_refused_before_any_search(machine, request_, binds):
    assert out_of_reach(machine, request_).name == binds


@pytest.mark.parametrize("request_", [
    Request(speed=0.5), Request("turn", speed=1.5), Request("sideways", speed=0.4, right=True), Request("backward", speed=0.3),
    Request("arc", speed=0.34, radius=0.5), Request(speed=0.15, limits=GaitLimits(rms=0.28))])
def test_what_gaits_have_done_is_not_refused(machine, request_):
    assert out_of_reach(machine, request_) is None


def test_options_that_cannot_be_met_end_in_one_line(capsys, tmp_path):
    out = ["--out", str(tmp_path / "out")]
    assert "expected at most 1.39 N m" in refused(capsys, "optimize", "--rms", "99", *out)
    assert STANDING in refused(capsys, "optimize", "--rms", "0.001", "--speed", "0.1", *out)
    tight = refused(capsys, "optimize", "--arc", "1e-9", *out)
    assert "expected 0.012 to 191 m on this robot, got 1e-09; tighter is a turn in place" in tight
    for absurd in (("--speed", "1e300"), ("--turn", "1e9"), ("--arc", "0.3", "--speed", "500")):
        assert "cannot be met by any gait: foot speed" in refused(capsys, "optimize", *absurd, *out)
    assert "wider is straight ahead" in refused(capsys, "optimize", "--turn", "1e-6", "--speed", "0.1", *out)
    assert "neither of them max" in refused(capsys, "optimize", "--turn", "max", "--speed", "0.1", *out)
    assert "expected sideways, turn or arc" in refused(capsys, "optimize", "--right", *out)
    start = tmp_path / "gait.csv"
    assert "file not found" in refused(capsys, "optimize", "--start", str(start), *out)
    start.touch()
    assert "the certificate is missing" in refused(capsys, "optimize", "--start", str(start), *out)
    assert "expected a method that searches" in refused(capsys, "optimize", "--start", "x.csv", "--method", "plan", *out)
    assert not (tmp_path / "out" / "gait.csv").exists()
