"""Fixtures that several files share."""

import pytest

from tests.gap_worn import CONFIG, HIDDEN, gathered
from workbench.identify.fitting.fits import Search
from workbench.identify.rollouts.evaluator import RolloutEvaluator
from workbench.simulation.compiled import compile_lanes, compile_station


def pytest_configure(config):
    """Compiles the station once, on disk, before each of several workers would."""
    if getattr(config.option, "numprocesses", None) and not hasattr(config, "workerinput"):
        compile_station()
        compile_lanes()


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    """An arm whose joint `three` is stiffer than its model says: session, search and nominal fit."""
    session, evidence = gathered(tmp_path_factory.mktemp("worn"), HIDDEN)
    search = Search(RolloutEvaluator(evidence, CONFIG, n_jobs=1), session.model)
    return session, search, search.evaluate([])
