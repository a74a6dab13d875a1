"""Where Drake has judged the compiled station on a model, finer steps and predictions are compiled, with equal results."""

from dataclasses import replace

import numpy as np
import pytest

import workbench.simulation.compiled
from tests.gap_sessions import record_arm
from workbench.compare.compare_session import roll_out, roll_out_judged, run_of
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes
from workbench.simulation import SimulationConfig
from workbench.simulation.compiled import run_compiled

DRAKE = SimulationConfig(engine="drake")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("arm")
    record_arm(folder)
    return replace(run_of(read_takes(load_session(folder / "session.yaml"))[0][0]), duration=0.4)


@pytest.fixture(scope="module")
def drakes(run):
    return roll_out([run], DRAKE, n_jobs=1)[0]


def compiled_by(run, monkeypatch, turned=0.0):
    """The rollouts, and the steps of those that were compiled. turned [rad]: error given to the compiled station."""
    steps = []

    def counted(job):
        steps.append(job.config.time_step)
        take = run_compiled(job)
        return replace(take, q=take.q + turned)

    monkeypatch.setattr(workbench.simulation.compiled, "run_compiled", counted)
    return roll_out_judged([run], DRAKE, n_jobs=1)[0], steps


@pytest.mark.parametrize("rolled", [roll_out, roll_out_judged])
def test_the_last_of_the_finer_steps_is_the_finest(run, rolled):
    """Whichever is simulated first: `finer` is half the step, then a quarter of it."""
    fine = replace(DRAKE, engine="auto")
    done = rolled([run], fine, n_jobs=1)[0]
    for take, k in zip(done.finer, (2, 4), strict=True):
        own = roll_out([run], replace(fine, time_step=fine.time_step / k), n_jobs=1, floors=False)[0].nominal
        at = np.searchsorted(own.time, take.time[take.time <= own.time[-1]] - 1e-9)
        np.testing.assert_allclose(take.q[:len(at)], own.q[at], atol=1e-9)


def test_finer_steps_are_compiled_and_as_drakes(run, drakes, monkeypatch):
    judged, steps = compiled_by(run, monkeypatch)
    step = DRAKE.time_step
    assert steps == [step, step / 4, step / 2]
    np.testing.assert_array_equal(judged.nominal.q, drakes.nominal.q)
    for ours, theirs in zip(judged.finer, drakes.finer, strict=True):
        np.testing.assert_allclose(ours.q, theirs.q, atol=1e-9)


def test_where_the_compiled_station_is_wrong_they_are_drakes(run, drakes, monkeypatch):
    judged, steps = compiled_by(run, monkeypatch, turned=1e-4)
    assert steps == [DRAKE.time_step]
    for ours, theirs in zip(judged.finer, drakes.finer, strict=True):
        np.testing.assert_array_equal(ours.q, theirs.q)
