"""Rollouts that the table's diagnoses remember, so that only what changed is rolled out again."""

import shutil
from pathlib import Path

import pytest

from workbench.identify.rollout_key import rollout_code


@pytest.fixture(scope="session")
def remembered(request) -> Path:
    """A folder in pytest's cache, for the code that rollouts run through as it is; what other code rolled out goes."""
    folder = request.config.cache.mkdir("diagnose_rollouts") / rollout_code()[:16]
    for other in folder.parent.iterdir():
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    folder.mkdir(exist_ok=True)
    return folder
