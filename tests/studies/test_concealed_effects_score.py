"""How the trial scores a diagnosis: on constructed findings, and compared with the score of the practice sessions."""

import importlib.util
import json
import shutil

import numpy as np
import pytest

from studies.concealed_effects.generator import make
from studies.concealed_effects.plan import SessionPlan
from studies.concealed_effects.score import score, score_folder, score_nothing
from studies.concealed_effects.sealed import Vault
from studies.concealed_effects.summary import NOTHING, bounds, confusion, criteria, reliability, summary
from tests.concealed_answers import finding, said, truth
from tests.shared_data import shared

PLAY = ("backlash", ["flm"], {"gap": 3.0})


def called(result):
    """(effect, reported name, share of the place) of each hidden effect."""
    return [(e.effect, ("tie: " if e.tie else "") + e.called, e.share) for e in result.effects]


def test_an_effect_is_named_exactly_or_in_a_tie_and_placed_by_share():
    exact = score(truth(PLAY), said(finding("backlash", ["flm"], gap=(3.3, 2.9, 3.6))))
    assert (called(exact), exact.false_alarms) == ([("backlash", "backlash", 1.0)], [])
    (size,) = exact.parameters
    assert (size.error, size.inside) == (pytest.approx(0.1), True)
    tied = score(truth(PLAY), said(finding("dead_band", ["flm", "frm"], tie="backlash")))
    assert (called(tied), tied.parameters) == ([("backlash", "tie: dead_band", 0.5)], [])
    assert tied.effects[0].named
    wrong = score(truth(PLAY), said(finding("dead_band", ["flm"])))
    assert (called(wrong), wrong.false_alarms, wrong.calibration) == (
        [("backlash", "dead_band", None)], ["dead_band flm"], [(0.95, False)])
    assert not wrong.effects[0].named
    silent = score(truth(PLAY), said(finding("backlash", ["flm"], confidence=0.4)))
    assert called(silent) == [("backlash", "abstained", None)]


def test_a_finding_is_used_once():
    both = truth(("coulomb_friction", ["flm"], {"torque": 0.1}), ("coulomb_friction", ["frb"], {"torque": 0.2}))
    result = score(both, said(finding("coulomb_friction", ["frb"])))
    assert sorted(e.called for e in result.effects) == ["abstained", "coulomb_friction"]


def test_physics_without_a_name_asks_for_another_verdict_than_explained():
    hidden = truth(("gear_ripple", ["flm"], {"torque": 0.2, "period": 12}), outside=["gear_ripple"])
    pressed = score(hidden, said(finding("coulomb_friction", ["flm"])))
    assert (pressed.wrongly_explained, pressed.effects, pressed.quiet) == (True, [], False)
    assert not score(hidden, said(verdict="unexplained")).wrongly_explained
    elsewhere = score(hidden, said(finding("backlash", ["brb"]), verdict="partly_explained"))
    assert elsewhere.false_alarms == ["backlash brb"]


def test_soft_ground_is_neither_hit_nor_alarm_and_its_session_not_quiet():
    hidden = truth(("soft_ground", [], {"stiffness": 2e3}))
    result = score(hidden, said(finding("soft_ground", [])))
    assert (result.effects, result.false_alarms, result.quiet) == ([], [], False)


def test_a_diagnosis_that_failed_named_nothing():
    result = score_nothing(truth(PLAY), "took more than 60 s")
    assert (called(result), result.verdict, result.complaint) == (
        [("backlash", "failed", None)], "failed", "took more than 60 s")


def test_the_summary_counts_what_was_counted_by_hand():
    scores = [score(truth(PLAY), said(finding("backlash", ["flm"], gap=(3.3, 3.1, 3.6)))),
              score(truth(PLAY), said(finding("backlash", ["flm"], gap=(2.7, 2.5, None)))),
              score(truth(), said(finding("payload", ["rod"], confidence=0.6))), score(truth(), said(verdict="no_gap"))]
    named, placed, alarms, explained, held, covered, error = criteria(scores)
    assert (named.value, placed.value, alarms.value, explained.value) == (1.0, 1.0, 1.0, None)
    assert (named.met, placed.met, alarms.met, explained.met) == (True, True, False, None)
    assert (covered.value, covered.met) == (0.5, False)
    assert (error.value, error.met) == (pytest.approx(0.1), True)
    assert confusion(scores) == {("backlash", "backlash"): 2, (NOTHING, "payload"): 1}
    bins = reliability(scores)
    assert [(b.findings, b.true) for b in bins] == [(1, 0), (2, 2)]
    assert bins[1].holds
    assert bins[1].low == pytest.approx(0.025 ** 0.5)
    assert held.value == 1.0
    result = summary(scores, planned=4)
    assert (result["quiet"], result["diagnosed"], result["met"]) == (2, 4, False)
    assert json.loads(json.dumps(result, allow_nan=False))["sessions"][1]["parameters"][0]["high"] is None


def test_a_trial_meets_what_is_asked_only_where_all_of_it_is_done():
    rng = np.random.default_rng(5)
    good = []
    for i in range(40):  # of intervals, 90 % cover; of findings of confidence 0.95, 95 % are true
        gap = (3.1, 2.8, 3.4) if i % 10 else (3.4, 3.2, 3.6)
        place = ["flm"] if i % 20 else ["frm"]
        good.append(score(truth(PLAY), said(finding("backlash", place, 0.95 + 0.02 * rng.uniform(), gap=gap))))
    good += [score(truth(), said(verdict="no_gap")),
             score(truth(("floor_step", [], {}), outside=["floor_step"]), said(verdict="unexplained"))]
    assert all(c.met for c in criteria(good))
    assert summary(good, planned=42)["met"]
    assert not summary(good, planned=43)["met"]
    assert not summary([*good, score(truth(), said(finding("payload", ["rod"])))], planned=43)["met"]


def test_bounds_are_those_of_a_binomial():
    low, high = bounds(8, 10)
    assert (low, high) == pytest.approx((0.4439, 0.9748), abs=1e-4)  # Clopper and Pearson's table
    assert bounds(0, 5)[0] == 0
    assert bounds(5, 5)[1] == 1


@pytest.mark.slow
def test_predictions_close_the_gap_or_do_not(tmp_path):
    make(tmp_path, Vault(tmp_path / "sealed", seed=3), SessionPlan("s000", "rig", ("coulomb_friction",), False, 11))
    answer = Vault(tmp_path / "sealed").open("s000")
    (tmp_path / "predict").mkdir()
    (tmp_path / "findings.json").write_text(json.dumps(said(finding("coulomb_friction", ["swing"]))))
    for suffix, expected in ((".csv", 1.0), (".nominal.csv", 0.0)):
        for take in ("hidden_waves", "hidden_steps"):
            (tmp_path / "predict" / f"{take}.csv").write_bytes(answer[take + suffix])
        closed = score_folder(answer, tmp_path, tmp_path).closed
        assert set(closed.values()) - {None} == {expected}


FOUND = {
    "p1_backlash": [said(finding("backlash", ["flm"], gap=(3.4, 2.0, 3.6))),
                    said(finding("dead_band", ["frb", "flm"], tie="backlash"),
                         finding("payload", ["body_link"], confidence=0.7))],
    "p7_two_at_once": [said(finding("servo_gain", ["brb"], ratio=(0.5, 0.46, None)), finding("soft_ground", [])),
                       said(finding("ground_friction", [], friction=(0.29, 0.25, 0.33)),
                            finding("coulomb_friction", ["brb"], confidence=0.6), verdict="partly_explained")],
}


@pytest.mark.parametrize("case", sorted(FOUND))
def test_scores_are_those_of_the_practice_sessions_score(case, tmp_path):
    spec = importlib.util.spec_from_file_location("judge", shared("tools/score.py"))
    judge = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(judge)
    folder = shared(f"practice/{case}/answer")
    (tmp_path / "predict").mkdir()
    # One prediction as good as the recording, one as bad as another robot's.
    shutil.copy(folder / "hidden_stand.csv", tmp_path / "predict")
    shutil.copy(shared("practice/p6_stiff_gearbox/answer/hidden_walk.csv"), tmp_path / "predict")
    theirs = json.loads((folder / "truth.json").read_text())
    answer = {p.name: p.read_bytes() for p in folder.glob("*.csv")} | {"truth.json": json.dumps(in_our_words(theirs)).encode()}
    for findings in FOUND[case]:
        (tmp_path / "findings.json").write_text(json.dumps(findings))
        want, got = judge.score(folder / "truth.json", tmp_path, folder), score_folder(answer, tmp_path, tmp_path)
        assert len(got.effects) == want["effects"]
        assert sum(e.named and not e.tie for e in got.effects) == want["exact"]
        assert sum(e.tie for e in got.effects) == want["tied"]
        assert sum(e.share or 0.0 for e in got.effects) == want["placed"]
        assert len(got.false_alarms) == want["false_alarms"]
        assert got.calibration == want["calibration"]
        assert [(p.effect, p.inside) for p in got.parameters] == [(p["effect"], p["inside"]) for p in want["parameters"]]
        assert [p.error for p in got.parameters] == pytest.approx([p["relative_error"] for p in want["parameters"]])
        closed = {take: unseen["closed"] for take, unseen in want["unseen"].items()}
        assert got.closed == pytest.approx(closed, abs=1e-6)
        assert closed["hidden_walk"] < 0 or closed["hidden_stand"] == 1


def in_our_words(theirs):
    """A practice session's truth as the trial writes its own."""
    names = {"backlash": ("gap", np.rad2deg(1)), "servo_gain": ("ratio", 1), "ground_friction": ("friction", 1)}
    effects = [(e["effect"], [e["joint"]] if "joint" in e else [], {names[e["effect"]][0]: e["value"] * names[e["effect"]][1]})
               for e in theirs["effects"]]
    return truth(*effects, name=theirs["name"]) | {"robot": "quadruped", "takes": theirs["takes"]}
