"""Drake judges the compiled station in every diagnosis; rollouts are cached by everything they depend on."""

from __future__ import annotations

import pytest

import workbench.simulation.compiled
from tests.gap_sessions import record_arm
from workbench.compare.session import load_session
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.rollouts import key as rollout_key
from workbench.identify.rollouts.captured import channels_stream
from workbench.simulation import Simulation, SimulationConfig
from workbench.view.report.diagnosis import diagnosis_report


@pytest.fixture
def session(tmp_path):
    record_arm(tmp_path)
    return load_session(tmp_path / "session.yaml")


def test_a_diagnosis_says_which_engine_it_stands_on(session, tmp_path, monkeypatch):
    told = diagnose_session(session, n_jobs=1, memory=tmp_path).diagnosis
    engine = told.provenance["engine"]
    assert engine["rollouts by"] == "the compiled station"
    assert engine["nominal model apart from Drake [sigma]"] < 1e-3
    assert engine["final model apart from Drake [sigma]"] < 1e-3

    def no_more(rollouts, n_jobs):
        assert not rollouts, "a rollout that was remembered"
        return iter(())

    monkeypatch.setattr("workbench.identify.rollouts.evaluator.channels_stream", no_more)
    again = diagnose_session(session, n_jobs=1, memory=tmp_path).diagnosis
    assert again.verdict == told.verdict
    monkeypatch.setattr(rollout_key, "rollout_code", lambda: "another version")
    with pytest.raises(AssertionError, match="remembered"):
        diagnose_session(session, n_jobs=1, memory=tmp_path)


def test_where_engines_part_a_diagnosis_is_drakes(session, monkeypatch):
    def wrong(rollouts, n_jobs):
        for rollout, channels in zip(rollouts, channels_stream(rollouts, n_jobs)):
            yield channels if rollout.job.config.engine == "drake" else channels * 1.01

    monkeypatch.setattr("workbench.identify.rollouts.evaluator.channels_stream", wrong)
    result = diagnose_session(session, n_jobs=1)
    engine = result.diagnosis.provenance["engine"]
    assert engine["rollouts by"] == "Drake"
    assert "nominal model" in engine["because"]
    assert "compiled station and Drake part" in diagnosis_report(result.diagnosis, result.takes, "arm").summary


def test_a_simulation_is_drakes(monkeypatch, session):
    monkeypatch.setattr(workbench.simulation.compiled, "run_compiled", None)
    assert Simulation(session.model, SimulationConfig(base="fixed")).run(None, 0.01) is not None
