"""Rollouts of gaits, of which those that lie on the floor or trip over themselves need no exact end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from workbench.cache import Cache
from workbench.recording.take import Take
from workbench.simulation import Job, simulate_batch
from workbench.simulation.cluster import in_blocks, on_cluster
from workbench.simulation.compiled import CompiledJob, NotCoveredError, covers

KEPT = 64
"""Robots whose arrays and pose at rest are kept: an ensemble and the nominal one, with room."""


class Rollouts:
    """Plays gaits on robots repeatedly; everything independent of the gait is computed once for each robot."""

    def __init__(self, n_jobs: int = 2) -> None:
        self.n_jobs = n_jobs
        self._robots: Cache[CompiledJob] = Cache(KEPT)

    def takes(self, jobs: Sequence[Job], as_seen: bool = True) -> Iterator[Take | None]:
        """The take of each job, in their order; None where the compiled station gave up because something other than a foot
        touched the floor, or two links each other. Jobs whose kind it does not cover are Drake's. as_seen: as in
        `CompiledJob.take`."""
        if not jobs:
            return
        if covers(jobs[0]) is not None:  # the kind is the same for all: engine, contact, step
            yield from simulate_batch(jobs, self.n_jobs)
            return
        if self.n_jobs > 1 and len(jobs) > 1 and on_cluster():
            yield from in_blocks(partial(_play_block, as_seen), jobs, self.n_jobs)
            return
        prepared = [self._prepare(job) for job in jobs]
        if self.n_jobs == 1:
            yield from (_take(job, as_seen) for job in prepared)
            return
        with ThreadPoolExecutor(self.n_jobs) as threads:
            yield from threads.map(lambda job: _take(job, as_seen), prepared)

    def _prepare(self, job: Job) -> CompiledJob | None:
        key = f"{job.model.sha256} {job.config!r}"
        try:
            return self._robots.get(key, lambda: CompiledJob(job, apart=True)).of(job)
        except NotCoveredError:
            return None


_of_this_process = Rollouts(1)
"""A worker's own, so that it settles each robot once however many blocks it gets."""


def _play_block(as_seen: bool, jobs: Sequence[Job]) -> list[Take | None]:
    """A block of jobs, in a worker."""
    return list(_of_this_process.takes(jobs, as_seen))


def _take(job: CompiledJob | None, as_seen: bool) -> Take | None:
    try:
        return None if job is None else job.take(as_seen)
    except NotCoveredError:
        return None
