"""Many runs in parallel, on this machine's cores or on a Dask cluster, by joblib."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

from workbench.files import InputError
from workbench.recording.take import Take
from workbench.simulation.cluster import on_cluster, stream_results
from workbench.simulation.job import Job
from workbench.simulation.rollout import Simulation

__all__ = ["Job", "run_job", "simulate_batch", "simulate_stream"]

KEPT_STATIONS = 3


def simulate_batch(jobs: Sequence[Job], n_jobs: int = 2, progress: Callable[[int, int], None] | None = None) -> list[Take]:
    """Takes of the jobs, in their order, the same whatever `n_jobs` is. Worker processes keep their last stations, so that
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
    """The takes of `simulate_batch` one by one, each as soon as it and those before it are done, while the others continue.

    Jobs that the compiled station covers run in threads of this process, the rest in processes."""
    if n_jobs == 1 or len(jobs) == 1:
        return (run_job(job) for job in jobs)
    if on_cluster():
        return _in_processes(jobs, n_jobs)
    return _in_threads_and_processes(jobs, n_jobs)


def _in_threads_and_processes(jobs: Sequence[Job], n_jobs: int) -> Iterator[Take]:
    here = [_is_compiled(job) for job in jobs]
    elsewhere = _in_processes([_by_drake(job) for job, c in zip(jobs, here) if not c], n_jobs)
    with ThreadPoolExecutor(n_jobs) as threads:
        started = [threads.submit(run_job, job) if c else None for job, c in zip(jobs, here)]
        try:
            for run in started:
                yield next(elsewhere) if run is None else run.result()
        finally:
            threads.shutdown(cancel_futures=True)


def _in_processes(jobs: Sequence[Job], n_jobs: int) -> Iterator[Take]:
    if not jobs:
        return
    from joblib import delayed

    yield from stream_results((delayed(run_job)(job) for job in jobs), n_jobs)


_stations: OrderedDict[Any, Simulation] = OrderedDict()
_one_at_a_time = threading.Lock()
"""Threads whose jobs turn out to be Drake's after all share these stations, of which each plays one job at a time."""


def run_job(job: Job) -> Take:
    """Runs one job in this process, with the engine of its configuration."""
    if job.config.engine == "drake":
        return _run_by_drake(job)
    from workbench.simulation.compiled import NotCoveredError, run_compiled

    try:
        return run_compiled(job)
    except NotCoveredError as why:
        if job.config.engine == "compiled":
            raise InputError(None, f"engine 'compiled' does not know: {why}; expected 'auto' or 'drake'") from why
        return _run_by_drake(job)


def _is_compiled(job: Job) -> bool:
    """Whether the compiled station is to play a job, as far as can be told before it runs."""
    if job.config.engine == "drake":
        return False
    from workbench.simulation.compiled import covers

    return job.config.engine == "compiled" or covers(job) is None


def _by_drake(job: Job) -> Job:
    return replace(job, config=replace(job.config, engine="drake"))


def _run_by_drake(job: Job) -> Take:
    """Runs a job by Drake, on a kept station if model and configuration equal an earlier job's."""
    key = (job.model.sha256, replace(job.config, engine="drake"))
    with _one_at_a_time:
        if key not in _stations:
            _stations[key] = Simulation(job.model, job.config)
        _stations.move_to_end(key)
        while len(_stations) > KEPT_STATIONS:
            _stations.popitem(last=False)
        take = _stations[key].run(job.commands, job.duration, job.lead, trajectory=job.trajectory, path=job.path, start=job.start,
                                  elapsed=job.elapsed, steadied=job.steadied, name=job.name)
    return take if job.times is None else replace(take, torque=None, contact={}).resampled(job.times)
