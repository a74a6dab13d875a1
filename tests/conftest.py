"""Fixtures that several files share."""

import pytest

from tests.gap_worn import CONFIG, HIDDEN, gathered
from workbench.identify.fitting.fits import Search
from workbench.identify.rollouts import RolloutEvaluator


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    """An arm whose joint `three` is stiffer than its model says: session, search and nominal fit."""
    session, evidence = gathered(tmp_path_factory.mktemp("worn"), HIDDEN)
    search = Search(RolloutEvaluator(evidence, CONFIG, n_jobs=1), session.model)
    return session, search, search.evaluated([])
