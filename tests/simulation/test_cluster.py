"""The same batch call on a Dask cluster, here a local one."""

import warnings

import numpy as np
import pytest

from workbench.motion import load_motion
from workbench.robot import data_file, puppy_model
from workbench.simulation import Job, SimulationConfig, simulate_batch

distributed = pytest.importorskip("distributed")
joblib = pytest.importorskip("joblib")


@pytest.mark.filterwarnings("default")  # of Dask, not of ours
def test_a_batch_on_a_dask_cluster_gives_the_same_takes():
    model = puppy_model()
    walk = load_motion(data_file("robotis_walk.csv"), model).commands(1)
    jobs = [Job(model, SimulationConfig(base="fixed"), walk, 0.05 * (1 + i), name=str(i)) for i in range(3)]
    local = simulate_batch(jobs, n_jobs=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        client = distributed.Client(n_workers=2, threads_per_worker=1, dashboard_address=None)
        with client, joblib.parallel_config(backend="dask"):
            remote = simulate_batch(jobs, n_jobs=2)
    for a, b in zip(local, remote):
        assert a.name == b.name
        assert np.array_equal(a.q, b.q)
