"""The page of a diagnosis and its figures, on takes whose gap is known."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.arm import arm_sdf
from tests.example_diagnosis import diagnosis, finding
from tests.view_takes import small_robot, swing
from workbench.cli.diagnose import finding_line
from workbench.identify.results.findings import (
    Alternative,
    Diagnosis,
    Estimate,
    NextExperiment,
    Unexplained,
)
from workbench.identify.results.reasons import Dependence, DownwardPull, Outdone, ParameterDrift, WorseInPlace
from workbench.identify.results.take_report import TakeReport
from workbench.robot import RobotModel
from workbench.view.figures import encode
from workbench.view.figures.gap import before_after, gap_map, robot_map, unseen_errors
from workbench.view.report.diagnosis import diagnosis_report, write_diagnosis
from workbench.view.report.words import headline, in_words, interval, intervals_of, left_row, next_said, sentence_of, title_of

SIGMA = np.deg2rad(0.1)


@pytest.fixture
def model(tmp_path: Path) -> RobotModel:
    return small_robot(tmp_path)


@pytest.fixture
def take(model: RobotModel) -> TakeReport:
    """Two degrees are missing at flm in the nominal model from 0.5 s on, nothing in the fitted one; some frames were not seen."""
    fitted = swing(model).resampled(np.arange(-0.3, 1.19, 0.01))
    rng = np.random.default_rng(0)
    away = np.where((fitted.time > 0.5)[:, None] & (np.array(model.joints) == "flm"), np.deg2rad(2.0), 0.0)
    q = fitted.q + rng.normal(0, SIGMA, fitted.q.shape)
    q[40:45] = np.nan
    recorded = replace(fitted, name="walk", source="recording", q=q)
    nominal = replace(fitted, q=fitted.q - away)
    moving = np.where(fitted.time[:, None] > 0, 1.0, np.nan)
    before, after = ((q - take.q) / SIGMA * moving for take in (nominal, fitted))
    return TakeReport(recorded, nominal, fitted, model.joints, np.full(len(model.joints), SIGMA), before, after,
                     (fitted.time > 0.7) & (fitted.time < 0.9))


def test_ratios_are_of_unseen_frames(take: TakeReport) -> None:
    before, after = take.ratios(take.before), take.ratios(take.after)
    assert before["flm"] == pytest.approx(20, rel=0.05)
    assert after["flm"] == pytest.approx(1, abs=0.3)
    assert before["frb"] == after["frb"]
    assert take.sigma("flm") == pytest.approx(SIGMA)
    nowhere = replace(take, before=np.full_like(take.before, np.nan))
    assert np.isnan(nowhere.ratios(nowhere.before)["flm"])
    assert np.isnan(nowhere.sigma("flm"))


def test_a_story_on_other_frames_is_refused(take: TakeReport) -> None:
    with pytest.raises(ValueError, match="before: expected residuals of shape"):
        replace(take, before=take.before[:-1])
    with pytest.raises(ValueError, match="on the recording's frames"):
        replace(take, unseen=take.unseen[:-1])


def test_the_map_is_dark_where_and_when_the_gap_is(take: TakeReport) -> None:
    figure = gap_map(take)
    left, right = (axes.collections[0].get_array() for axes in figure.axes[:2])
    row = take.channels.index("flm")
    assert left[row, 8] == pytest.approx(20, rel=0.1)  # 0.8 to 0.9 s
    assert left[row, 2] < 2
    assert right.max() < 3
    others = np.delete(left, row, axis=0)
    assert others.max() < 3
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == list(take.channels)
    assert left.shape == (4, 12)
    held_out = np.concatenate([line.get_xdata() for line in figure.axes[0].lines]).reshape(-1, 3)  # begin, end, gap
    drawn = np.any([(take.time >= low) & (take.time < high) for low, high, _ in held_out], axis=0)
    np.testing.assert_array_equal(drawn[:-1], (take.unseen & (take.time >= 0))[:-1])
    assert len(gap_map(replace(take, after=take.before)).axes) == 2  # one map and its scale


def test_a_time_that_nobody_saw_is_grey(take: TakeReport) -> None:
    before = take.before.copy()
    before[(take.time > 0.3) & (take.time < 0.45)] = np.nan
    cells = gap_map(replace(take, before=before)).axes[0].collections[0].get_array()
    assert np.ma.getmaskarray(cells)[:, 3].all()
    assert not np.ma.getmaskarray(cells)[:, 5].any()


def test_the_robot_says_its_worst_joint(model: RobotModel) -> None:
    said = [t.get_text() for t in robot_map(model, {"flm": 20.0, "frm": 1.1, "flb": float("nan")}).axes[0].texts]
    assert "flm 20.0×" in said
    assert "frm" in said  # within the limit: no number


def test_names_of_joints_in_one_line_stand_apart(tmp_path: Path) -> None:
    (tmp_path / "arm.sdf").write_text(arm_sdf(True))
    arm = RobotModel(description=str(tmp_path / "arm.sdf"), base="base")
    texts = robot_map(arm, dict.fromkeys(arm.joints, 9.0)).axes[0].texts
    x, y = np.transpose([t.xyann for t in texts])
    assert len(texts) == len(arm.joints)
    assert np.abs(np.diff(np.sort(y))).min() > 0.05 * np.ptp([t.xy[0] for t in texts])
    assert x.min() > max(t.xy[0] for t in texts)


def test_before_and_after_shows_the_worst_unseen_stretch(take: TakeReport) -> None:
    figure = before_after(take, "flm")
    top, strip = figure.axes
    low, high = strip.get_xlim()
    assert low <= 0.7
    assert high >= 0.9
    nominal, fitted = strip.get_lines()
    assert np.nanmax(nominal.get_ydata()) == pytest.approx(2.0, abs=0.5)
    assert np.nanmax(np.abs(fitted.get_ydata())) < 0.5
    assert [line.get_label() for line in top.get_lines()] == ["recorded", "nominal", "fitted"]


def test_before_and_after_shows_what_was_judged_not_a_take_that_starts_when_another_model_would_have_it(take: TakeReport) -> None:
    late = replace(take.fitted, q=np.roll(take.fitted.q, 5, axis=0))
    _, fitted = before_after(replace(take, fitted=late), "flm").axes[1].get_lines()
    assert np.nanmax(np.abs(fitted.get_ydata())) < 0.5


@pytest.mark.parametrize("draw", [gap_map, lambda s: unseen_errors([s]), lambda s: before_after(s, "flb")])
def test_figures_can_be_written_even_where_nothing_was_seen(take: TakeReport, draw) -> None:
    nothing = np.full_like(take.before, np.nan)
    figure = draw(replace(take, before=nothing, after=nothing, unseen=np.zeros(len(take.unseen), dtype=bool)))
    assert isinstance(figure, Figure)
    assert len(encode(figure).content) > 1000


@pytest.mark.parametrize(("estimate", "said"), [
    (Estimate(3.1, 2.7, 3.5, "deg"), "3.1 deg (2.7 to 3.5)"),
    (Estimate(0.45, 0.4, 0.5, "1"), "0.45 (0.4 to 0.5)"),
    (Estimate(1.02697, 1.0265, 1.0274, "1"), "1.027 (1.0265 to 1.0274)"),
    (Estimate(50.0, 20.0, inf, "N m/rad"), "50 N m/rad (at least 20)"),
    (Estimate(0.1, -inf, 0.3, "N m"), "0.1 N m (at most 0.3)"),
    (Estimate(0.1, -inf, inf, "N m"), "0.1 N m (not bounded by the data)"),
    (Estimate((0.03, 0.0, 0.04), (0.0, 0.0, 0.0), (0.1, 0.2, 0.3), "m"), "50 mm in magnitude"),
    (Estimate(0.012, 0.01, 0.015, "s"), "12 ms (10 to 15)"),
])
def test_intervals_are_said_as_a_person_would(estimate: Estimate, said: str) -> None:
    assert interval(estimate) == said


def test_a_vector_has_a_row_for_each_component_in_a_unit_that_suits_the_largest() -> None:
    offset = Estimate((0.0399, -0.00034, -0.0178), (0.0392, -0.00048, -0.0215), (0.0405, -0.0002, inf), "m")
    assert intervals_of("com_offset", offset) == [
        ["com offset, x", "39.9 mm (39.2 to 40.5)"], ["com offset, y", "-0.3 mm (-0.5 to -0.2)"],
        ["com offset, z", "-17.8 mm (at least -21.5)"]]
    assert intervals_of("force", Estimate((0.0, 0.0, 0.0), (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), "N"))[2] == [
        "force, z", "0 N (-1 to 1)"]
    assert intervals_of("gap", Estimate(3.1, 2.7, 3.5, "deg")) == [["gap", "3.1 deg (2.7 to 3.5)"]]


@pytest.mark.parametrize(("entry", "row"), [
    (Unexplained(("brm",), 0.567, 0.206, "deg", Dependence("sway", "brm", "angle", 0.55)),
     ["joint brm", "sway", "0.567 deg", "2.8×", "moderately with its angle (0.55)"]),
    (Unexplained((), 0.00546, 0.00178, "m", Dependence("walk", "forward")),
     ["forward motion of the body", "walk", "5.46 mm", "3.1×", "not with time"]),
    (Unexplained(("flm",), 1.0, 0.5, "deg", Dependence("walk", "flm~z", "time", 0.8)),
     ["flm, across its axis (z)", "walk", "1 deg", "2.0×", "strongly with time (0.80)"]),
    (Unexplained(("frb",), 0.6, 0.2, "deg", ParameterDrift("com_shift", ("frb_link",), "offset", 1.0, 2.0, "m")),
     ["frb", "", "0.6 deg", "3.0×", "offset of centre of mass shift at frb_link would have to change from 1 to 2 m within a "
                                     "take: the cause may be something that varies with time"]),
])
def test_what_is_left_is_said_in_plain_words(entry: Unexplained, row: list[str]) -> None:
    assert left_row(entry) == row


def test_a_doubt_about_a_name_is_said_but_not_as_an_error_of_the_fitted_model(model: RobotModel, take: TakeReport) -> None:
    hangs = Unexplained((), 0.75, 0.12, "N", DownwardPull("tether_force", 0.0762))
    off = Unexplained(("brm",), 0.567, 0.206, "deg", Dependence("sway", "brm"))
    told = {n: diagnosis_report(replace(diagnosis(model), unexplained=left), [take], "Session small").html()
            for n, left in enumerate([(hangs,), (hangs, off)])}
    assert all("The tether force is a vertical pull of 76 g, but without the inertia of a load" in page for page in told.values())
    assert ["still has errors above noise" in page for page in told.values()] == [False, True]


def test_reasons_name_effects_as_people_do() -> None:
    worse = WorseInPlace("com_shift", ("body_link",), 686.4)
    assert in_words(worse).startswith("in place of centre of mass shift at body_link it leaves chi squared 686 higher")
    assert str(worse).startswith("in place of com_shift(body_link) it leaves chi squared 686 higher")
    assert "it leaves chi squared only 3 lower" in str(replace(worse, behind=-3.2))
    other = Outdone("a_plug_in", (), 40.0, 7.0)
    assert in_words(other) == "a plug in reduces chi squared by 40 on the stretches that decide between effects, this one by 7"


def test_the_next_experiment_is_a_link_and_says_what_it_tells_apart() -> None:
    told = next_said(NextExperiment("next_experiment.csv", "free", (("backlash", "dead_band"),), (np.log(150.0),)))
    assert "[next_experiment.csv](next_experiment.csv) with the robot free on the floor" in told
    assert "backlash from dead band (expected odds in favour of the correct effect: 150 to 1)" in told
    assert "more than 1000 to 1" in next_said(NextExperiment("n.csv", "fixed", (("a", "b"),), (800.0,)))
    assert "odds" not in next_said(NextExperiment("n.csv", "fixed", (("a", "b"),)))


def test_a_tie_is_seen_wherever_the_finding_is(model: RobotModel, take: TakeReport) -> None:
    tied = replace(finding(confidence=0.86), alternatives=(Alternative("joint_compliance", ("flm",), 0.12),))
    page = diagnosis_report(replace(diagnosis(model), findings=(tied,)), [take], "Session small").html()
    assert "<h1>Backlash at flm (or joint compliance at flm) explains the model" in page
    assert "probability 86 %; or joint compliance at flm: 12 %" in page
    assert "<b>Or joint compliance at flm: 12 %.</b>" in page


def test_a_tie_of_two_is_as_sure_as_both_together(model: RobotModel, take: TakeReport) -> None:
    tied = replace(finding(confidence=0.5), alternatives=(Alternative("joint_compliance", ("flm",), 0.46),))
    page = diagnosis_report(replace(diagnosis(model), findings=(tied,)), [take], "Session small").html()
    assert "probability 96 % that it is this or joint compliance at flm" in page
    assert "50 %, or joint compliance at flm 46 %; together 96 %" in page
    line = finding_line(tied)
    assert "(confidence 0.96 that it is this or joint compliance at flm, which these recordings cannot separate" in line


def test_a_sentence_is_said_once_in_its_section(model: RobotModel, take: TakeReport) -> None:
    told = finding()
    page = diagnosis_report(replace(diagnosis(model), findings=(replace(told, evidence=sentence_of(told)),)), [take], "S").html()
    assert page.count(sentence_of(told)) == 2  # in the summary and in the section
    assert "structure errors (how links and joints are built: 8 of 8)" in page
    assert '<a href="next_experiment.csv">next_experiment.csv</a>' in page
    assert "whole robot" not in page


def test_the_verdict_is_one_sentence(model: RobotModel) -> None:
    full = diagnosis(model)
    assert headline(full) == "Backlash at flm explains the model's entire error."
    two = replace(full, verdict="partly_explained", findings=(finding(), replace(finding("ground_friction"), where=())))
    assert headline(two).startswith("Backlash at flm and ground friction explain part of")
    guess = replace(finding("ground_friction"), where=(), confidence=0.4, alternatives=())
    assert headline(replace(two, findings=(finding(), guess))) == (
        "Backlash at flm explains part of the model's error; the rest is not yet identified with certainty.")
    assert headline(replace(two, findings=(guess,))) == (
        "No known effect is a likely explanation of the model's error; the closest candidate is ground friction.")
    nothing = replace(full, findings=(), gap=(), rejected=(), unexplained=(), next_experiment=None)
    assert headline(replace(nothing, verdict="no_gap")).startswith("The nominal model explains these recordings")
    assert "no known effect explains the difference" in headline(replace(nothing, verdict="unexplained"))


def test_the_page_reads_from_top_to_bottom(model: RobotModel, take: TakeReport, tmp_path: Path) -> None:
    paths = write_diagnosis(diagnosis(model), [take], tmp_path / "out", "Session small")
    assert sorted(p.name for p in paths) == ["findings.json", "model.yaml", "nominal.yaml", "replay-walk.html", "report.html"]
    page = (tmp_path / "out/report.html").read_text()
    order = ["Backlash at flm explains the model", "flm has 2.0 deg of free play", "trot was left out: line 9",
             "Where the recordings differ from the model", "2 more places and times", "Or joint compliance at flm: 2 %",
             "2 deg (1.8 to 2.3)",
             "Alternatives that were tried", "dead band at flm reduces chi squared", "Before and after, on unseen stretches",
             "Residuals", "a &lt;take&gt;", "What else was tried", "its response does not match the residuals",
             "What to record next", "next_experiment.csv", "See it move", "<b>seed</b> 7"]
    places = [page.find(words) for words in order]
    assert -1 not in places, order[places.index(-1)]
    assert places == sorted(places)


def test_a_session_without_a_gap_has_a_page_too(model: RobotModel, take: TakeReport) -> None:
    quiet = replace(take, before=take.after, nominal=take.fitted, unseen=take.time > 0.2)
    page = diagnosis_report(Diagnosis("no_gap", model, model), [quiet], "Session quiet").html()
    assert "The recordings do not differ from the nominal model by more than chance." in page
    assert "every channel is within" in page
    assert "What to record next" not in page
    assert "no_gap" not in diagnosis_report(Diagnosis("unexplained", model, model), [], "Nothing to show").html()


def test_a_search_that_came_to_its_limit_says_so(model: RobotModel, take: TakeReport) -> None:
    whole, stopped = diagnosis(model), replace(diagnosis(model), stopped=True)
    assert "work limit" not in diagnosis_report(whole, [take], "Session small").html()
    assert "work limit" in diagnosis_report(stopped, [take], "Session small").html()
    assert "stopped" not in whole.to_json()
    assert stopped.to_json()["stopped"] is True


def test_places_that_tie_are_said_as_a_choice(model: RobotModel) -> None:
    told = replace(diagnosis(model).findings[0], where=("flm", "flb"))
    assert title_of(told.effect, told.where).endswith("at flm or flb")
    assert sentence_of(told).endswith("Or the same at flb: these recordings do not distinguish them.")
    assert sentence_of(replace(told, where=("flm",))) in sentence_of(told)


def test_the_card_shows_the_number_that_the_data_tell(model: RobotModel, take: TakeReport) -> None:
    stop = replace(finding("joint_stop"), parameters={
        "lower": Estimate(-180.0, -inf, inf, "deg"), "upper": Estimate(12.6, 11.9, 13.2, "deg")})
    page = diagnosis_report(replace(diagnosis(model), findings=(stop,)), [take], "Session small").html()
    card = page[page.lower().index("joint stop at flm<"):]
    assert card.index("12.6 deg") < card.index("-180 deg")


def test_a_finding_of_the_whole_robot_is_shown_where_no_other_finding_is(model: RobotModel, take: TakeReport) -> None:
    floor = replace(finding("ground_friction"), where=(), parameters={"friction": Estimate(0.3, 0.2, 0.4, "1")})
    pages = [diagnosis_report(replace(diagnosis(model), findings=found), [take], "Session small").html()
             for found in ((floor,), (finding(), floor), (floor, finding()))]
    assert len({page.count("flm in walk: what") for page in pages}) == 1
