"""The trial of diagnosis: what is drawn, how it is sealed, how it is scored; on a small robot, and on findings made by hand."""

import json
from collections import Counter

import numpy as np
import pytest

from studies.concealed_effects.catalogue import CATALOGUE, draw, possible
from studies.concealed_effects.conceal import Bench, conceal
from studies.concealed_effects.generator import make
from studies.concealed_effects.plan import MAKERS, SessionPlan, plan_sessions
from studies.concealed_effects.run import publish
from studies.concealed_effects.score import score, score_folder
from studies.concealed_effects.sealed import Vault
from studies.concealed_effects.summary import confusion, reliability, summary
from studies.concealed_effects.takes import logged_takes
from studies.other_engine.hidden import OUTSIDE
from workbench.gap.session import load_session
from workbench.recording import read_recording
from workbench.robot import InputError


def test_a_hundred_sessions_hold_what_the_trial_asks():
    plans = plan_sessions(7)
    assert len({p.name for p in plans}) == 100
    outside = [p for p in plans if set(p.effects) & set(OUTSIDE)]
    assert (sum(not p.effects for p in plans), len(outside)) == (25, 15)
    several = [p for p in plans if len(p.effects) > 1]
    assert sum(p.masked for p in several) == (len(several) + 1) // 2
    assert max(len(p.effects) for p in plans) == 3
    dealt = Counter(e for p in plans for e in p.effects)
    assert set(dealt) >= set(CATALOGUE) - set(OUTSIDE), "every effect of the contract is hidden somewhere"
    for p in plans:
        able = set(possible(MAKERS[p.robot](np.random.default_rng(0)), False)) | set(OUTSIDE)
        assert set(p.effects) <= able
    assert plan_sessions(7) == plans
    assert plan_sessions(8) != plans


@pytest.mark.parametrize("kind", sorted(MAKERS))
def test_every_effect_can_be_drawn_for_every_robot_that_shows_it(kind):
    robot = MAKERS[kind](np.random.default_rng(3))
    for effect in (*possible(robot, False), *possible(robot, True)):
        for share in (0.0, 1.0):
            spec = draw(effect, np.random.default_rng(5), robot).at(share)
            assert spec.effect == effect
            assert all(np.isfinite(v).all() for v in spec.parameters.values())


def test_a_seal_opens_to_what_was_sealed_and_not_to_anything_else(tmp_path):
    vault = Vault(tmp_path / "sealed")
    committed = vault.seal("s000", {"truth.json": '{"effects": ["backlash"]}'})
    assert b"backlash" not in (tmp_path / "sealed/s000.sealed").read_bytes()
    assert Vault(tmp_path / "sealed").open("s000") == {"truth.json": b'{"effects": ["backlash"]}'}
    assert vault.commitments == {"s000": committed}
    with pytest.raises(ValueError, match="already"):
        vault.seal("s000", {})
    content = bytearray((tmp_path / "sealed/s000.sealed").read_bytes())
    content[10] ^= 1
    (tmp_path / "sealed/s000.sealed").write_bytes(bytes(content))
    with pytest.raises(InputError, match="committed"):
        vault.open("s000")


def test_seals_are_published_before_anything_is_diagnosed_and_do_not_change(tmp_path):
    vault = Vault(tmp_path / "sealed")
    vault.seal("s000", {"truth.json": "{}"})
    publish(tmp_path, vault, lambda _: None)
    publish(tmp_path, vault, lambda _: None)
    vault.seal("s001", {"truth.json": "{}"})
    with pytest.raises(ValueError, match="published"):
        publish(tmp_path, vault, lambda _: None)
    (tmp_path / "commitment.json").unlink()
    (tmp_path / "results").mkdir()
    with pytest.raises(ValueError, match="before"):
        publish(tmp_path, vault, lambda _: None)


def truth(*effects, outside=(), masked=False):
    specs = [{"effect": e, "where": w, "parameters": p} for e, w, p in effects]
    return {"name": "s", "robot": "rig", "effects": specs, "masked": masked, "outside": list(outside), "takes": {}}


def finding(effect, where, confidence=0.95, tie=None, **values):
    parameters = {k: {"value": v, "low": low, "high": high, "unit": ""} for k, (v, low, high) in values.items()}
    ties = [{"effect": tie, "where": where, "confidence": 0.3}] if tie else []
    return {"effect": effect, "where": where, "confidence": confidence, "parameters": parameters, "alternatives": ties}


def said(*findings, verdict="explained"):
    return {"verdict": verdict, "findings": list(findings), "provenance": {"seconds": 60}}


PLAY = ("backlash", ["flm"], {"gap": 3.0})


def test_an_effect_is_named_exactly_or_in_a_tie_and_placed_by_share():
    exact = score(truth(PLAY), said(finding("backlash", ["flm"], gap=(3.3, 2.9, 3.6))))
    assert (exact.named, exact.placed, exact.false_alarms) == ([("backlash", "backlash")], [1.0], [])
    (size,) = exact.parameters
    assert size.error == pytest.approx(0.1)
    assert size.inside
    assert size.bounded
    tied = score(truth(PLAY), said(finding("dead_band", ["flm", "frm"], tie="backlash")))
    assert (tied.named, tied.placed, tied.parameters) == ([("backlash", "tie: dead_band")], [0.5], [])
    wrong = score(truth(PLAY), said(finding("dead_band", ["flm"])))
    assert (wrong.named, wrong.false_alarms, wrong.calibration) == ([("backlash", "dead_band")], ["dead_band"], [(0.95, False)])
    silent = score(truth(PLAY), said(finding("backlash", ["flm"], confidence=0.4)))
    assert silent.named == [("backlash", "abstained")]


def test_a_finding_is_used_once():
    both = truth(("coulomb_friction", ["flm"], {"torque": 0.1}), ("coulomb_friction", ["frb"], {"torque": 0.2}))
    result = score(both, said(finding("coulomb_friction", ["frb"])))
    assert sorted(c for _, c in result.named) == ["abstained", "coulomb_friction"]


def test_physics_without_a_name_asks_for_another_verdict_than_explained():
    hidden = truth(("gear_ripple", ["flm"], {"torque": 0.2, "period": 12}), outside=["gear_ripple"])
    pressed = score(hidden, said(finding("coulomb_friction", ["flm"])))
    assert pressed.wrongly_explained
    assert pressed.named == []
    honest = score(hidden, said(verdict="unexplained"))
    assert not honest.wrongly_explained
    elsewhere = score(hidden, said(finding("backlash", ["brb"]), verdict="partly_explained"))
    assert elsewhere.false_alarms == ["backlash"]


def test_the_summary_counts_what_was_counted_by_hand():
    scores = [score(truth(PLAY), said(finding("backlash", ["flm"], gap=(3.3, 3.1, 3.6)))),
              score(truth(PLAY), said(finding("backlash", ["flm"], gap=(2.7, 2.5, None)))),
              score(truth(), said(finding("payload", ["rod"], confidence=0.6))), score(truth(), said(verdict="no_gap"))]
    result = summary(scores)
    assert (result["named"], result["placed"], result["quiet_sessions"], result["false_alarms_in_quiet"]) == (1.0, 1.0, 2, 1)
    assert result["median_size_error"] == pytest.approx(0.1)
    assert (result["coverage"], result["bounded"]) == (0.5, 0.5)
    assert confusion(scores) == {("backlash", "backlash"): 2}
    bins = reliability(scores)
    assert [(b.findings, b.true) for b in bins] == [(1, 0), (2, 2)]
    assert bins[1].holds
    assert bins[1].low == pytest.approx(0.025 ** 0.5)


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    out = tmp_path_factory.mktemp("trial")
    make(out, Vault(out / "sealed"), SessionPlan("s000", "rig", ("coulomb_friction",), False, 11))
    return out


def test_a_session_shows_nothing_of_what_is_hidden_and_can_be_read(trial):
    session = load_session(trial / "sessions/s000/session.yaml")
    assert [t.name for t in session.takes] == ["slow", "quick", "steps"]
    assert not session.model.effects
    for take in session.takes:
        assert read_recording(take.recording).commands is not None
    files = [p for p in (trial / "sessions").rglob("*") if p.is_file()]
    assert len(files) == 8
    assert not any("friction" in p.read_text() for p in files if p.suffix == ".csv")


def test_predictions_close_the_gap_or_do_not(trial, tmp_path):
    answer = Vault(trial / "sealed").open("s000")
    hidden = json.loads(answer["truth.json"])["effects"]
    assert [e["effect"] for e in hidden] == ["coulomb_friction"]
    (tmp_path / "predict").mkdir()
    (tmp_path / "findings.json").write_text(json.dumps(said(finding("coulomb_friction", ["swing"]))))
    for suffix, expected in ((".csv", 1.0), (".nominal.csv", 0.0)):
        for take in ("hidden_waves", "hidden_steps"):
            (tmp_path / "predict" / f"{take}.csv").write_bytes(answer[take + suffix])
        closed = score_folder(answer, tmp_path, tmp_path).closed
        assert set(closed.values()) - {None} == {expected}


def test_what_is_concealed_shows(tmp_path):
    rng = np.random.default_rng(1)
    robot = MAKERS["arm"](rng)
    model = robot.model(tmp_path / "arm.sdf")
    bench = Bench(robot, model, [t for t in logged_takes(model, rng) if not t.predict][1:])
    (effect,) = conceal(bench, ["servo_gain"], False, rng)
    assert bench.shows(effect) > 1.5
