"""Fixtures that several files share."""

import pytest

from tests.gap_worn import CONFIG, HIDDEN, gathered
from workbench.identify.fitting.fits import Search
from workbench.identify.rollouts import RolloutEvaluator
from workbench.robot import puppy_model
from workbench.simulation import Job, SimulationConfig
from workbench.simulation.batch import run_job
from workbench.simulation.compiled.kernel import is_compiled


def pytest_configure(config):
    """Compiles the station once, on disk, before each of several workers would."""
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput") and not is_compiled():
        run_job(Job(puppy_model(), SimulationConfig(base="fixed", settle=0.0, engine="compiled"), None, 0.01, 0.0))


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    """An arm whose joint `three` is stiffer than its model says: session, search and nominal fit."""
    session, evidence = gathered(tmp_path_factory.mktemp("worn"), HIDDEN)
    search = Search(RolloutEvaluator(evidence, CONFIG, n_jobs=1), session.model)
    return session, search, search.evaluate([])
