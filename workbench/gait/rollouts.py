"""Rollouts of gaits, of which those that lie on the floor or trip over themselves need no exact end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

from workbench.recording.take import Take
from workbench.simulation import Job, simulate_batch
from workbench.simulation.compiled import NotCoveredError, covers, run_compiled


def rollouts(jobs: Sequence[Job], n_jobs: int = 2) -> Iterator[Take | None]:
    """The take of each job, in their order; None where the compiled station gave up because something other than a foot touched
    the floor, or two links each other. Jobs whose kind it does not cover are Drake's."""
    if not jobs:
        return
    if covers(jobs[0]) is not None:  # the kind is the same for all: engine, contact, step
        yield from simulate_batch(jobs, n_jobs)
        return
    with ThreadPoolExecutor(n_jobs) as threads:
        yield from threads.map(_take, jobs)


def _take(job: Job) -> Take | None:
    try:
        return run_compiled(job)
    except NotCoveredError:
        return None
