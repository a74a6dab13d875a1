"""The replay of diagnoses: truths in one form, and two versions' answers side by side."""

from __future__ import annotations

import numpy as np
import pytest

from studies.concealed_effects.score import score
from studies.replay.sessions import COUNT, SEED, known_sessions
from studies.replay.table import Pair, table, verdict
from tests.shared_data import shared


def answer(*findings, verdict="explained"):
    return {"verdict": verdict, "findings": [
        {"effect": effect, "where": [where], "confidence": sure, "parameters": {"gap": {"value": 3.1, "low": 2.9, "high": 3.3}}}
        for effect, where, sure in findings]}


TRUTH = {"name": "one", "robot": "quadruped", "masked": False, "outside": [], "takes": {},
         "effects": [{"effect": "backlash", "where": ["flm"], "parameters": {"gap": 3.0}}]}


@pytest.fixture
def right():
    return score(TRUTH, answer(("backlash", "flm", 0.9)))


def test_what_another_version_said_stands_before_an_arrow(right):
    lost = score(TRUTH, answer(("coulomb_friction", "frm", 0.7)))
    text = table([Pair("one", right, lost), Pair("two", right, right)])
    one, two = text.splitlines()[1:3]
    assert "1/1 -> 0/1" in one
    assert "3% -> -" in one
    assert "- -> coulomb_friction frm" in one
    assert "->" not in two
    assert "before: 2 of 2 named" in text
    assert "now: 1 of 2 named, 1.0 placed, 1 invented" in text


def test_losing_or_inventing_an_effect_is_an_error(right):
    lost = score(TRUTH, answer())
    invented = score(TRUTH, answer(("backlash", "flm", 0.9), ("dead_band", "frm", 0.8)))
    assert verdict([Pair("one", right, right), Pair("two", None, lost)]) == 0
    assert verdict([Pair("one", right, lost)]) == verdict([Pair("one", right, invented)]) == 1


def test_practice_sessions_are_told_in_the_trials_words(tmp_path):
    shared("practice/p1_backlash")
    by_name = {s.name: s for s in known_sessions(tmp_path, count=0)}
    (effect,) = by_name["p1_backlash"].truth["effects"]
    assert effect["where"] == ["flm"]
    assert np.isclose(effect["parameters"]["gap"], 3.0)
    assert by_name["p0_nothing_hidden"].truth["effects"] == []
    assert COUNT + len(by_name) == 30
    assert SEED
