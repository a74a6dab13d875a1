"""Rollouts that the table's diagnoses remember, so that only what changed is rolled out again."""

import shutil
from pathlib import Path

import pytest

from workbench.identify.rollouts.key import rollout_code


@pytest.fixture(scope="session")
def remembered(request, tmp_path_factory) -> Path:
    """A folder in pytest's cache, if there is one, for the code that rollouts run through as it is; what other code rolled out
    goes."""
    cache = getattr(request.config, "cache", None)
    kept = tmp_path_factory.mktemp("rollouts") if cache is None else cache.mkdir("diagnose_rollouts")
    folder = kept / rollout_code()[:16]
    for other in folder.parent.iterdir():
        if other != folder:
            shutil.rmtree(other, ignore_errors=True)
    folder.mkdir(exist_ok=True)
    return folder
