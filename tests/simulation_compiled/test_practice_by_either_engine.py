"""The practice sessions diagnosed by either engine: the same findings, numbers within a quarter of half their interval."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from tests.shared_data import practice
from workbench.compare.session import load_session
from workbench.identify.diagnosis import diagnose_session
from workbench.simulation import SimulationConfig

SESSIONS = ("p0_nothing_hidden", "p1_backlash", "p2_slippery_foot", "p3_payload", "p4_late_firmware", "p5_sagging_supply",
            "p6_stiff_gearbox", "p7_two_at_once")
SHARE = 0.25
"""Of half an interval's width by which the engines' numbers may part. The engines agree to 1e-9, but rounding decides where a fit
stops: 0.11 (payload's height) and 0.19 (timing drift) were seen."""


@pytest.mark.slow
@pytest.mark.parametrize("name", SESSIONS)
def test_either_engine_finds_the_same(name, monkeypatch):
    session = load_session(practice(name))
    compiled = diagnose_session(session).diagnosis
    assert compiled.provenance["engine"]["rollouts by"] == "the compiled station"
    monkeypatch.setattr("workbench.identify.diagnosis.SimulationConfig", partial(SimulationConfig, engine="drake"))
    drake = diagnose_session(session).diagnosis
    assert compiled.verdict == drake.verdict
    assert [(f.effect, f.where) for f in compiled.findings] == [(f.effect, f.where) for f in drake.findings]
    for ours, theirs in zip(compiled.findings, drake.findings):
        for parameter, mine in ours.parameters.items():
            other = theirs.parameters[parameter]
            half = (np.asarray(other.high, dtype=float) - np.asarray(other.low, dtype=float)) / 2
            apart = np.abs(np.asarray(mine.value, dtype=float) - np.asarray(other.value, dtype=float))
            assert np.all(apart <= SHARE * np.where(np.isfinite(half), half, np.inf)), (ours.effect, parameter)
