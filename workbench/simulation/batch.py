"""Many runs over both cores, or over a Dask cluster, by joblib."""

from __future__ import annotations

import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from joblib import Parallel, delayed

from workbench.motion.commands import Commands
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation.config import SimulationConfig
from workbench.simulation.rollout import Array, Simulation, Start
from workbench.simulation.steady import BaseStates

KEPT_STATIONS = 3


@dataclass(frozen=True)
class Job:
    """One run: what Simulation.run takes, of a model in a configuration. times: (N,) [s] after the first command at which
    the take is wanted, without torques and contact; the whole log if None. Less log is less traffic between processes."""

    model: RobotModel
    config: SimulationConfig
    commands: Commands | None = None
    duration: float | None = None
    lead: float = 0.1
    trajectory: tuple[Array, Array] | None = None
    path: Take | None = None
    name: str = "simulation"
    times: Array | None = None
    start: Start | tuple[Array, Array] | None = None
    elapsed: float = 0.0
    steadied: BaseStates | None = None


def simulate_batch(jobs: Sequence[Job], n_jobs: int = 2, progress: Callable[[int, int], None] | None = None) -> list[Take]:
    """Takes of all jobs, in their order, the same whatever `n_jobs` is. Worker processes keep their last stations, so that
    jobs that differ in commands alone build none. Inside `joblib.parallel_config(backend="dask")` the jobs run on the
    client's cluster. progress: called with (done, all).
    """
    takes: list[Take] = []
    for take in simulate_stream(jobs, n_jobs):
        takes.append(take)
        if progress:
            progress(len(takes), len(jobs))
    return takes


def simulate_stream(jobs: Sequence[Job], n_jobs: int = 2) -> Iterable[Take]:
    """The same takes one by one, each as soon as it and those before it are there; the others go on meanwhile."""
    if n_jobs == 1 or len(jobs) == 1:
        return (run_job(job) for job in jobs)
    return _in_processes(jobs, n_jobs)


def _in_processes(jobs: Sequence[Job], n_jobs: int) -> Iterable[Take]:
    with warnings.catch_warnings():  # joblib restarts a worker that has grown and says so: nothing is lost
        warnings.filterwarnings("ignore", message="A worker stopped while some jobs")
        yield from Parallel(n_jobs=n_jobs, return_as="generator")(delayed(run_job)(job) for job in jobs)


_stations: OrderedDict[Any, Simulation] = OrderedDict()


def run_job(job: Job) -> Take:
    """One job in this process, on a kept station where model and configuration are those of an earlier job."""
    key = (job.model.sha256, job.config)
    if key not in _stations:
        _stations[key] = Simulation(job.model, job.config)
    _stations.move_to_end(key)
    while len(_stations) > KEPT_STATIONS:
        _stations.popitem(last=False)
    take = _stations[key].run(job.commands, job.duration, job.lead, trajectory=job.trajectory, path=job.path, start=job.start,
                              elapsed=job.elapsed, steadied=job.steadied, name=job.name)
    return take if job.times is None else replace(take, torque=None, contact={}).resampled(job.times)
