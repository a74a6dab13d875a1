"""Angles alone of many runs of a held robot, straight from the compiled station: what fits of servo logs ask by the thousand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.cache import Cache
from workbench.simulation.compiled.arrays import Ints, Schedule
from workbench.simulation.compiled.schedule import schedule_of
from workbench.simulation.compiled.station import CompiledJob
from workbench.simulation.job import Job
from workbench.simulation.steady import JointStates
from workbench.types import Array

KEPT = 256
"""Schedules of commands, and ways to read a log, that are kept, as a session's takes are played again and again."""


class _Reading(NamedTuple):
    """Where between rows of a log the wanted times are. row, following (M,): the rows before and after; share (M, 1): of the way
    between them; outside (M,): times before or after the log; put: times right after a restart, each with share (k, 1) and the
    angles (n,) at the restart."""

    row: Ints
    following: Ints
    share: Array
    outside: NDArray[np.bool_]
    put: list[tuple[Ints, Array, Array]]


_schedules: Cache[Schedule] = Cache(KEPT)
_readings: Cache[_Reading] = Cache(KEPT)


def servo_angles(jobs: Sequence[Job]) -> list[Array]:
    """Of each job the angles (M, n) [rad] of the servos at its `times`, as their own sensors tell them, NaN outside the run.
    Jobs of one model share its arrays. NotCoveredError gives the reason why a job has to be Drake's."""
    machines: dict[Any, CompiledJob] = {}
    out = []
    for job in jobs:
        key = (id(job.model), id(job.config))
        compiled = machines[key].of(job) if key in machines else CompiledJob(job)
        machines.setdefault(key, compiled)
        log = compiled.log(_schedule(compiled))
        out.append(_read(log.q[:, compiled.machine.servos.joint] - compiled.physics.zero, _reading(compiled, len(log.q))))
    return out


def _read(rows: Array, reading: _Reading) -> Array:
    """Angles (M, n) at the wanted times, from the rows of a log; right after a restart from where the robot was put."""
    before = rows[reading.row]
    angles = before + reading.share * (rows[reading.following] - before)
    for here, share, q in reading.put:
        angles[here] = np.where(np.isnan(q), angles[here], q + share * (rows[reading.following[here]] - q))
    angles[reading.outside] = np.nan
    return angles


def _reading(compiled: CompiledJob, rows: int) -> _Reading:
    """Of a job's log of so many rows."""
    job, lead, every = compiled.job, compiled.plan.lead, compiled.config.logged_every
    assert job.times is not None
    times = job.times

    def made() -> _Reading:
        time = np.asarray(np.arange(rows) * every - lead, float)
        row = np.clip(np.searchsorted(time, times, side="right") - 1, 0, rows - 1)
        following = np.minimum(row + 1, rows - 1)
        share = ((times - time[row]) / every)[:, None]
        put = [] if job.restarts is None else _after_restarts(times, time, job.restarts)
        return _Reading(row, following, share, (times < time[0]) | (times > time[-1]), put)

    return _readings.get((rows, every, lead, times.tobytes(), id(job.restarts)), made, job.restarts)


def _after_restarts(times: Array, time: Array, restarts: JointStates) -> list[tuple[Ints, Array, Array]]:
    """`_Reading.put`: the log's row at a restart is of the robot as it came there. time: of the log's rows."""
    k = np.searchsorted(time, times, side="left")  # the row at or after each time
    at = np.round(restarts.times / (time[1] - time[0])).astype(int) - round(time[0] / (time[1] - time[0]))
    found = []
    for row, q in zip(at.tolist(), restarts.q):
        here = np.flatnonzero((k == row + 1) & (k < len(time)))
        if len(here):
            found.append((here, ((times[here] - time[row]) / (time[row + 1] - time[row]))[:, None], q))
    return found


def _schedule(compiled: CompiledJob) -> Schedule:
    """Of a job; made once for the same commands."""
    job, plan, config = compiled.job, compiled.plan, compiled.config

    def made() -> Schedule:
        return schedule_of(config, plan.commands, plan.lead, plan.duration, job.elapsed, job.steadied, job.restarts)

    if not plan.heard_as_sent or job.commands is None or job.steadied is not None:
        return made()
    key = (id(job.commands), *vars(config).values(), compiled.model.joints, plan.lead, plan.duration, job.elapsed,
           id(job.restarts))
    return _schedules.get(key, made, (job.commands, job.restarts))
