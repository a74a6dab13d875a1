"""findings.json as the contract writes it."""

from __future__ import annotations

import json
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest

from tests.example_diagnosis import diagnosis
from workbench.identify.results.findings import Alternative, Diagnosis, Estimate
from workbench.identify.results.reasons import ScreenedOut
from workbench.robot import load_model, load_model_file, puppy_model

DIAGNOSIS = diagnosis(puppy_model(), gaps=1)
(BACKLASH,) = DIAGNOSIS.findings


def test_it_is_the_contracts_file(tmp_path: Path) -> None:
    paths = DIAGNOSIS.save(tmp_path / "out")
    assert [p.name for p in paths] == ["findings.json", "model.yaml", "nominal.yaml"]
    assert json.loads(paths[0].read_text()) == {
        "format": 1, "verdict": "explained",
        "gap": [{"layer": "structure", "where": ["flm"], "take": "walk", "when": [[0.5, 1.2]], "phase": "stance", "error": 2.0,
                 "floor": 0.1, "unit": "deg"}],
        "findings": [{
            "effect": "backlash", "where": ["flm"], "confidence": 0.97,
            "parameters": {"gap": {"value": 2.0, "low": 1.8, "high": 2.3, "unit": "deg"}},
            "alternatives": [{"effect": "joint_compliance", "where": ["flm"], "confidence": 0.02}],
            "fit": {"before": 1.9, "after": 0.12, "unit": "deg"}, "validation": {"before": 2.0, "after": 0.11, "unit": "deg"},
            "evidence": "It shows where the load turns."}],
        "rejected": [{"effect": "coulomb_friction", "where": ["flm"],
                      "reason": "dead_band(flm) reduces chi squared by 900 on the stretches that decide between effects, "
                                "this one by 40",
                      "validation": {"before": 2.0, "after": 1.9, "unit": "deg"}},
                     {"effect": "payload", "where": ["body_link"], "reason": str(ScreenedOut(12.0, 310.0))}],
        "unexplained": [{"where": ["frb"], "error": 0.6, "floor": 0.2, "unit": "deg",
                         "description": "a <take>: correlates with angle (0.60)"}],
        "next_experiment": {"motion": "next_experiment.csv", "base": "fixed", "separates": [["backlash", "joint_compliance"]]},
        "provenance": {"seed": 7, "seconds": 94}, "left_out": [{"take": "trot", "reason": "line 9: the file is cut"}]}
    assert load_model(paths[1]).effects == DIAGNOSIS.model.effects
    assert load_model_file(paths[2]).provenance["seconds"] == 94
    assert load_model(paths[2]).sha256 == puppy_model().sha256


@pytest.mark.parametrize(("own", "other", "said"), [(0.5, 0.48, 0.98), (0.4, 0.21, 0.61), (0.7, 0.28, 0.7), (0.9, None, 0.9)])
def test_of_a_tie_the_confidence_is_that_one_of_the_two_is_there(own: float, other: float | None, said: float) -> None:
    ties = () if other is None else (Alternative("joint_compliance", ("flm",), other),)
    told = replace(BACKLASH, confidence=own, alternatives=ties).to_json()
    assert told["confidence"] == pytest.approx(said)
    assert [a["confidence"] for a in told["alternatives"]] == [a.confidence for a in ties]


def test_no_bound_is_null_and_a_vector_three_numbers() -> None:
    estimate = Estimate((0.0, 0.1, 0.2), (-inf, 0.0, 0.1), (inf, 0.2, inf), "m").to_json()
    assert estimate == {"value": [0, 0.1, 0.2], "low": [None, 0, 0.1], "high": [None, 0.2, None], "unit": "m"}
    assert Estimate(50.0, 20.0, inf, "N m/rad").to_json()["high"] is None


def test_nothing_found_says_so() -> None:
    said = Diagnosis("no_gap", puppy_model(), puppy_model()).to_json()
    assert said["findings"] == said["gap"] == []
    assert said["next_experiment"] is None


def test_what_cannot_be_meant_is_refused() -> None:
    with pytest.raises(ValueError, match="probability"):
        replace(BACKLASH, confidence=1.2)
    with pytest.raises(ValueError, match="at most one alternative"):
        replace(BACKLASH, alternatives=BACKLASH.alternatives * 2)
    with pytest.raises(ValueError, match="between its bounds"):
        Estimate(3.0, 3.1, 3.5, "deg")
    with pytest.raises(ValueError, match="finite"):
        Estimate(inf, 0.0, inf, "N m")
    with pytest.raises(ValueError, match="the same shape"):
        Estimate((0.0, 0.0, 0.0), 0.0, 1.0, "m")


def test_a_number_that_is_none_is_a_defect(tmp_path: Path) -> None:
    broken = replace(DIAGNOSIS, unexplained=(replace(DIAGNOSIS.unexplained[0], error=float("nan")),))
    with pytest.raises(ValueError, match="JSON"):
        broken.save(tmp_path)
    assert not list(tmp_path.iterdir())
