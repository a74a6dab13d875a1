"""The searches of servo logs and of gaits on a Dask cluster, here a local one, give the same results as on one core."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.evidence.rig_logs import record
from workbench.compare.compare_session import roll_out, run_of
from workbench.compare.session_takes import read_takes, register_takes
from workbench.gait.evaluate import SEARCH
from workbench.gait.rollouts import Rollouts
from workbench.identify.preparation import gather
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.motion import load_motion
from workbench.robot import EffectSpec, data_file, puppy_model
from workbench.simulation import Job, SimulationConfig
from workbench.simulation.cluster import in_blocks, on_cluster

distributed = pytest.importorskip("distributed")
joblib = pytest.importorskip("joblib")
pytestmark = pytest.mark.filterwarnings("default")  # of Dask


@pytest.fixture(scope="module")
def cluster() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        client = distributed.Client(n_workers=2, threads_per_worker=1, dashboard_address=None)
        with client, joblib.parallel_config(backend="dask"):
            yield


def processes(items: Sequence[int]) -> list[tuple[int, int]]:
    return [(os.getpid(), item) for item in items]


def test_blocks_go_to_workers_and_come_back_in_order(cluster: None) -> None:
    assert on_cluster()
    done = list(in_blocks(processes, range(7), 2))
    assert [item for _, item in done] == list(range(7))
    assert os.getpid() not in {process for process, _ in done}
    assert len({process for process, _ in done}) == 2


@pytest.mark.slow
def test_servo_logs(tmp_path: Path, cluster: None) -> None:
    session = record(tmp_path)
    config = SimulationConfig(settle=0.6, contact_period=0, time_step=2e-3)
    takes, _ = read_takes(session)
    rollouts = {t.spec.name: r for t, r in zip(takes, roll_out([run_of(t) for t in takes], config, n_jobs=1))}
    evidence = gather(register_takes(session, takes, {n: r.nominal for n, r in rollouts.items()})[0], rollouts)
    models = [session.model.with_effect(EffectSpec("coulomb_friction", ("j",), {"torque": 0.004 * k})) for k in range(3)]
    questions = [RolloutRequest(m, (0, 1, 2), horizon=h) for m in models for h in (0.5, np.inf)]
    here = RolloutEvaluator(evidence, config, n_jobs=1).uncorrected(questions)
    spread = RolloutEvaluator(evidence, config, n_jobs=2).uncorrected(questions)
    for a, b in zip(here, spread, strict=True):
        for i in a:
            np.testing.assert_array_equal(a[i], b[i])


@pytest.mark.slow
def test_gaits(cluster: None) -> None:
    model = puppy_model()
    walks = [load_motion(data_file("robotis_walk.csv"), model).commands(n) for n in (1, 2, 3)]
    jobs = [Job(model, SEARCH, walk, 0.1 + 0.05 * k, 0.03) for k, walk in enumerate(walks)]
    for a, b in zip(Rollouts(1).takes(jobs), Rollouts(2).takes(jobs), strict=True):
        assert a is not None
        assert b is not None
        np.testing.assert_array_equal(a.q, b.q)
        np.testing.assert_array_equal(a.p_WB, b.p_WB)
