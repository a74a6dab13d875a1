"""The stages of the trial, with commands in place of the diagnosis that are quick, wrong, broken or slow."""

import json
import sys
import threading
import time

import pytest

from studies.concealed_effects.ask import Asker, StoppedError, asked
from studies.concealed_effects.carried import carry, take_up
from studies.concealed_effects.figures import confusion_figure, reliability_figure, sizes_figure, time_figure
from studies.concealed_effects.published import PAGE, as_text, keep, kept, kept_section, section
from studies.concealed_effects.sealed import Vault
from studies.concealed_effects.summary import confusion, reliability, sizes
from studies.concealed_effects.trial import diagnose, forget_failed, publish, report, scored
from tests.concealed_answers import finding, said, truth
from workbench.view.figures import encode

PLAY = ("backlash", ["flm"], {"gap": 3.0})
RIPPLE = ("gear_ripple", ["flm"], {"torque": 0.2, "period": 12})
TRUTHS = {"s000": truth(PLAY, name="s000"), "s001": truth(name="s001"), "s002": truth(PLAY, name="s002", masked=True),
          "s003": truth(RIPPLE, name="s003", outside=["gear_ripple"]), "s004": truth(PLAY, name="s004")}
SAID = {"s000": said(finding("backlash", ["flm"], gap=(3.3, 2.9, None))), "s001": said(verdict="no_gap"),
        "s003": said(finding("payload", ["body_link"], confidence=0.6), verdict="partly_explained")}
STAND_IN = """
import atexit, json, pathlib, sys, time
session, out = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[3])
with open(session.with_name("asked"), "a") as f:
    f.write("x")
answer = session.with_name("answer").read_text()
if answer == "fail":
    sys.exit("workbench: error: robot.sdf: no such joint")
if answer == "crash":
    atexit.register(print, "tidied up", file=sys.stderr)
    raise ValueError("singular matrix")
if answer == "slow":
    (out / "half").write_text("half")
    time.sleep(60)
memory = bytearray(60_000_000)
(out / "findings.json").write_text(answer)
"""


def asker(limit=30.0):
    return Asker((sys.executable, "-c", STAND_IN), limit)


@pytest.fixture
def out(tmp_path):
    """A trial whose sessions are made: two that come out well, one that fails, one outside, one whose results are no JSON."""
    vault = Vault(tmp_path / "sealed", count=len(TRUTHS), seed=5)
    for name, hidden in TRUTHS.items():
        vault.seal(name, {"truth.json": json.dumps(hidden)})
        (tmp_path / "sessions" / name).mkdir(parents=True)
        answer = "fail" if name == "s002" else "{" if name == "s004" else json.dumps(SAID[name])
        (tmp_path / "sessions" / name / "answer").write_text(answer)
    publish(tmp_path, vault, lambda _: None)
    return tmp_path


def how_often_asked(out):
    return {p.parent.name: len(p.read_text()) for p in (out / "sessions").glob("*/asked")}


def test_seals_are_published_before_anything_is_diagnosed_and_do_not_change(tmp_path):
    vault = Vault(tmp_path / "sealed", count=2)
    vault.seal("s000", {"truth.json": "{}"})
    with pytest.raises(ValueError, match="1 of 2"):
        publish(tmp_path, vault)
    vault.seal("s001", {"truth.json": "{}"})
    publish(tmp_path, vault)
    publish(tmp_path, vault)
    assert json.loads((tmp_path / "seal.json").read_text())["sessions"] == vault.commitments
    (tmp_path / "sealed/s001.sha256").write_text("0" * 64)
    with pytest.raises(ValueError, match="published"):
        publish(tmp_path, vault)
    (tmp_path / "seal.json").unlink()
    (tmp_path / "results").mkdir()
    with pytest.raises(ValueError, match="before"):
        publish(tmp_path, vault)


def test_a_session_is_asked_once_and_a_failure_is_counted_not_lost(out):
    lines = []
    diagnose(out, list(TRUTHS), asker(), workers=2, say=lines.append)
    assert how_often_asked(out) == dict.fromkeys(TRUTHS, 1)
    assert any("s002: failed: workbench: error: robot.sdf: no such joint" in line for line in lines)
    diagnose(out, list(TRUTHS), asker())
    assert how_often_asked(out) == dict.fromkeys(TRUTHS, 1)
    vault = Vault(out / "sealed")
    scores = {name: scored(out, vault, name) for name in TRUTHS}
    assert [s.verdict for s in scores.values()] == ["explained", "no_gap", "failed", "partly_explained", "failed"]
    assert "JSON" in scores["s004"].complaint
    assert scores["s000"].seconds > 0
    assert 60e6 < scores["s000"].memory < 2e9
    assert len(scores["s000"].code) == 12
    forget_failed(out)
    diagnose(out, list(TRUTHS), asker())
    assert how_often_asked(out) == dict.fromkeys(TRUTHS, 1) | {"s002": 2}


def test_a_diagnosis_that_takes_too_long_has_failed_and_one_that_is_stopped_has_not(out):
    (out / "sessions/s000/answer").write_text("slow")
    results = out / "results/s000"
    stopped = asker()
    threading.Timer(0.6, stopped.stop).start()
    with pytest.raises(StoppedError):
        diagnose(out, ["s000"], stopped)
    assert asked(results) is None
    assert not any(p.name.startswith(".s000") for p in results.parent.iterdir())
    began = time.monotonic()
    how = asker(limit=0.6).ask(out / "sessions/s000/session.yaml", results)
    assert time.monotonic() - began < 50, "it sleeps for a minute"
    assert (how.exit, how.complaint) == (-9, "took more than 0.6 s")


def test_a_crash_is_told_by_its_error(out):
    (out / "sessions/s001/answer").write_text("crash")
    diagnose(out, ["s001"], asker())
    how = asked(out / "results/s001")
    assert (how.exit, how.complaint) == (1, "ValueError: singular matrix")


def test_only_what_was_diagnosed_is_opened_and_a_part_is_called_a_part(out):
    vault = Vault(out / "sealed")
    (out / "sealed/s004.sealed").unlink()  # whoever opens it fails
    diagnose(out, ["s000", "s001"], asker())
    part = report(out, vault)
    assert (part["diagnosed"], part["planned"], part["met"]) == (2, 5, False)
    assert "seed" not in part
    page = (out / "report.html").read_text()
    assert "A partial trial, 2 of 5 sessions" in page
    assert "**Partial: 2 of 5 sessions.**" in section(part)


def test_the_whole_trial_on_a_page_and_in_the_repository(out, tmp_path):
    vault = Vault(out / "sealed")
    diagnose(out, list(TRUTHS), asker())
    whole = report(out, vault)
    assert (whole["failed"], whole["quiet"], whole["outside"], whole["masked"], whole["seed"]) == (2, 1, 1, 0, "5")
    assert whole["criteria"][0]["value"] == pytest.approx(1 / 3)
    assert json.loads((out / "summary.json").read_text()) == whole
    page = (out / "report.html").read_text()
    for part in ("chosen by hand", vault.digest(), "Confusion matrix", "How sure", "Sizes", "Every session",
                 "gear ripple flm (outside)", "no such joint"):
        assert part in page, part
    readme = tmp_path / "README.md"
    readme.write_text("# Before\n\n" + PAGE.read_text().partition("## Blind trials")[2])
    keep(whole, tmp_path / "trial.json", readme)
    assert kept(tmp_path / "trial.json") == whole
    assert kept_section(readme) == section(whole)
    text = readme.read_text()
    assert text.startswith("# Before")
    assert "| effects identified, exactly or as one of a tie of two | at least 90 % | 33 % (1 of 3;" in text
    keep(whole, tmp_path / "trial.json", readme)
    assert readme.read_text() == text
    assert "changed during the trial" not in text
    later = [s | {"code": "later"} for s in whole["sessions"][2:]]
    changed = section(whole | {"sessions": [*whole["sessions"][:2], *later]}).replace("\n", " ")
    assert "**The workbench changed during the trial**: 2 sessions by" in changed
    assert "3 sessions by the code with digest later, which identified" in changed
    (tmp_path / "elsewhere.md").write_text("nothing")
    with pytest.raises(ValueError, match="expected the lines"):
        keep(whole, tmp_path / "trial.json", tmp_path / "elsewhere.md")


def test_a_trial_goes_on_on_another_machine_with_what_is_left_of_it(out, tmp_path):
    """Scores are carried over; the remaining sessions are made again, and have to match their commitments."""
    vault, carried = Vault(out / "sealed"), tmp_path / "under_way.json"
    diagnose(out, ["s000", "s001"], asker())
    part = report(out, vault)
    assert carry(vault, part["sessions"], carried) == carried
    elsewhere = tmp_path / "elsewhere"
    other = take_up(elsewhere, carried)
    with pytest.raises(ValueError, match="begun here"):
        take_up(elsewhere, carried)
    assert (other.digest(), other.seed, other.drawn_by) == (vault.digest(), vault.seed, vault.drawn_by)
    publish(elsewhere, other)
    asked_before = report(elsewhere, other)
    assert asked_before["sessions"] == part["sessions"]
    assert asked_before["criteria"] == part["criteria"]
    with pytest.raises(ValueError, match="another session"):
        other.seal("s002", {"truth.json": "{}"})
    other.seal("s002", {"truth.json": json.dumps(TRUTHS["s002"])})
    (elsewhere / "sessions/s002").mkdir(parents=True)
    (elsewhere / "sessions/s002/answer").write_text(json.dumps(SAID["s000"]))
    diagnose(elsewhere, ["s002"], asker())
    assert report(elsewhere, other)["diagnosed"] == 3
    assert carry(other, part["sessions"] * 3, carried) is not None
    assert carry(other, [part["sessions"][0]] * other.count, carried) is None
    with pytest.raises(ValueError, match="under way"):
        take_up(tmp_path / "third", carried)


def test_the_readme_says_what_the_kept_trial_found():
    trial = kept()
    assert kept_section() == section(trial)
    if trial is not None:
        assert trial["seed_drawn_by"] == "os.urandom"
        assert as_text(trial) == as_text(json.loads(as_text(trial)))
        assert len(trial["sessions"]) == trial["diagnosed"]


def test_the_figures_show_what_there_is(out):
    vault = Vault(out / "sealed")
    diagnose(out, list(TRUTHS), asker())
    scores = [scored(out, vault, name) for name in TRUTHS]
    matrix = confusion_figure(confusion(scores)).axes[0]
    assert [t.get_text() for t in matrix.get_yticklabels()] == ["backlash", "nothing there"]
    assert [t.get_text() for t in matrix.get_xticklabels()] == ["backlash", "payload", "abstained", "failed"]
    assert sorted(t.get_text() for t in matrix.texts) == ["1", "1", "2"]
    for figure in (reliability_figure(reliability(scores)), sizes_figure(sizes(scores)),
                   time_figure([s.seconds for s in scores], [s.memory for s in scores])):
        assert len(encode(figure).content) > 1000
