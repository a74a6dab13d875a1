"""The page of a diagnosis whose cause angles do not tell."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from tests.example_diagnosis import diagnosis, finding
from tests.view_takes import small_robot
from workbench.cli.diagnose import finding_line
from workbench.identify.results.findings import Alternative, Estimate
from workbench.identify.results.servo_law import GravityOverTorque, TiedName
from workbench.view.report.diagnosis import diagnosis_report
from workbench.view.report.servo_law import tied_in_short
from workbench.view.report.words import headline


def test_a_tie_of_gravity_and_torque_leads_and_its_names_have_their_own_share(tmp_path: Path) -> None:
    model = small_robot(tmp_path)
    names = tuple(TiedName(effect, (where,), {}, f"It is {effect}.", behind)
                  for effect, where, behind in (
                      ("parallel_spring", "flm", 0.0), ("payload", "FLmid", 3.0), ("com_shift", "FLmid", 20.0)))
    tie = GravityOverTorque(("flm",), Estimate(1.3, 1.22, 1.41, "1"), 0.98, names, True, 7.0)
    spring = replace(finding("parallel_spring", 0.49), alternatives=(Alternative("payload", ("FLmid",), 0.49),), of_tie=0.98,
                     parameters={"stiffness": Estimate(0.3, 0.2, 0.4, "N m/rad")})
    found = replace(diagnosis(model), findings=(spring,), tied=(tie,))
    assert headline(found) == ("A change in the ratio of gravity to torque at flm (parallel spring at flm or payload at FLmid) "
                               "explains the model's entire error.")
    page = diagnosis_report(found, [], "Session small").html()
    assert "The ratio of gravity to torque in flm is 1.30 (1.22 to 1.41) times that of the earlier model. Angles alone" in page
    assert page.index("Causes that angles cannot distinguish") < page.index("<h2>Parallel spring at flm")
    assert "49 %, or payload at FLmid 49 %; one of several explanations of the ratio of gravity to torque, together 98 %" in page
    assert "98 % that it is this" not in page
    line = finding_line(spring)
    assert "(confidence 0.49, as one of several explanations of the ratio of gravity to torque, together 0.98" in line


def test_where_a_known_weight_leaves_one_cause_it_is_said() -> None:
    names = (TiedName("payload", ("FLmid",), {}, "It is a payload.", 26.0),)
    tie = GravityOverTorque(("flm",), Estimate(0.4, 0.38, 0.42, "1"), 0.0, names, False, 7.0, weighed=True)
    assert tied_in_short(tie).endswith("times that of the files. Cause: other torques of the servo.")
    assert "leave only one possible cause: all torques" in tie.in_words()


def test_without_a_known_weight_a_load_may_account_for_a_part() -> None:
    names = (TiedName("payload", ("FLmid",), {}, "It is a payload.", 26.0),)
    tie = GravityOverTorque(("flm",), Estimate(0.4, 0.38, 0.42, "1"), 0.0, names, False, 7.0)
    assert "alone or together with a change of its load" in tied_in_short(tie)
    assert "may account for part of it" in tie.in_words()
    assert "hang a known weight" in tie.in_words()
