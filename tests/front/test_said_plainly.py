"""Messages for inputs of the wrong kind, and the text of a report's tables."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

import workbench
from tests.command import refused
from workbench.identify.results.findings import Rejected
from workbench.identify.results.reasons import LessLikely, SpokenAgainst
from workbench.robot import EffectSpec, puppy_model
from workbench.view.report.page import Details, Table
from workbench.view.report.tables import rejected_table


def test_a_misspelled_robot_is_told_which_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(workbench.InputError, match="expected fox, puppy, or a file"):
        workbench.load_model("pupy")
    assert "expected fox, puppy, or a file" in refused(capsys, "view", "pupy")


def test_a_file_of_another_kind_is_told_what_was_expected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "findings.json").write_text('{"format": 1, "verdict": "no_gap"}')
    (tmp_path / "log.csv").write_text("time,goal.a\n0,1\n")
    with pytest.raises(workbench.InputError, match=r"no XML; expected a robot as SDF or URDF, or a model\.yaml"):
        workbench.load_model(tmp_path / "findings.json")
    assert "as in a session.yaml or a model.yaml" in refused(capsys, "diagnose", str(tmp_path / "log.csv"), "--out", "x")


def test_add_servos_says_what_to_do_with_effects() -> None:
    plant = MultibodyPlant(1e-3)
    model = puppy_model().with_effect(EffectSpec("zero_offset", ("flm",), {"angle": 1.0}))
    with pytest.raises(workbench.InputError, match=r"zero_offset.*MakeStation.*with_effects"):
        workbench.AddServos(DiagramBuilder(), plant, model)


def test_what_was_tried_is_sorted_by_how_much_less_likely() -> None:
    rejected = [Rejected("backlash", ("flm",), LessLikely(4.4)), Rejected("payload", ("body_link",), LessLikely(40.0)),
                Rejected("dead_band", ("flm",), LessLikely(0.7))]
    rows = [row for part in rejected_table(rejected, "more") for t in (part.parts if isinstance(part, Details) else [part])
            if isinstance(t, Table) for row in t.rows]
    assert ["2 times less" in str(row[-1]) for row in rows] == [True, False, False]
    assert "81 times less probable" in str(rows[1][-1])
    assert "more than 1,000,000 times less" in str(rows[2][-1])
    assert str(SpokenAgainst(7.0)) == "with it, the held-out takes are 1,000 times less probable"
