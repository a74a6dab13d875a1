"""How far heading wanders, and of what."""

import json
from dataclasses import replace

import numpy as np
import pytest

from studies import gait_conditions, gait_spread
from workbench.gait.ensemble import load_ensemble
from workbench.gait.measure import fallen


def test_the_parts_of_the_ensemble_are_the_whole():
    whole = load_ensemble()
    without, alone, every = gait_spread.parts(whole).values()
    assert without.zero_sd == 0.0
    assert alone.zero_sd == whole.zero_sd > 0
    assert set(without.ranges) | set(alone.ranges) == set(every.ranges)
    assert not set(without.ranges) & set(alone.ranges)
    assert alone.mass_share == alone.payload == 0.0


def test_the_robotis_walk_wanders_of_zero_offsets_and_latency_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(gait_conditions, "GAITS", tmp_path / "none")
    assert "wrote" in gait_spread.study(tmp_path / "out", True, lambda what, done: None)
    told = json.loads((tmp_path / "out/numbers.json").read_text())
    assert set(told["gaits"]) == {"ROBOTIS walk"}
    alone = told["gaits"]["ROBOTIS walk"]["zero offsets and latency alone"]
    assert alone["heading sd deg/m"] > 1.0
    assert alone["speed 5th percentile m/s"] <= alone["speed mean m/s"] < 0.1
    assert (tmp_path / "out/index.html").is_file()


def test_turning_is_told_by_distance():
    m = replace(fallen(1), fell=False, velocity=(0.3, 0.4), turn_rate=np.radians(10.0))
    assert gait_spread.turning(m) == pytest.approx(20.0)
