"""Angles alone of many runs of a held robot, straight from the compiled station: what fits of servo logs ask by the thousand."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.cache import Cache
from workbench.simulation.compiled.arrays import Ints, Schedule
from workbench.simulation.compiled.lanes.together import joint_angles
from workbench.simulation.compiled.schedule import schedule_of
from workbench.simulation.compiled.station import CompiledJob
from workbench.simulation.compiled.tables import NotCoveredError
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


def servo_angles(models: Sequence[Sequence[Job]], in_lanes: bool = True) -> list[list[Array] | NotCoveredError]:
    """For each model, of each of its jobs the angles (M, n) [rad] of the servos at the job's `times`, as their own sensors tell
    them, NaN outside the run; or the reason why one of the jobs has to be Drake's. Jobs of one model share its arrays. Robots of
    one structure play together, in lanes (`joint_angles`), where their jobs have the same states to be put to (one object), times
    and configuration. in_lanes: as there."""
    made = [_made(jobs) for jobs in models]
    plays = [(compiled, _schedule(compiled)) for each in made if not isinstance(each, NotCoveredError) for compiled in each]
    played = iter(joint_angles(plays, in_lanes))
    out: list[list[Array] | NotCoveredError] = []
    for each in made:
        if isinstance(each, NotCoveredError):
            out.append(each)
            continue
        logs = [(compiled, next(played)) for compiled in each]
        why = next((q for _, q in logs if isinstance(q, NotCoveredError)), None)
        out.append([_seen(compiled, q) for compiled, q in logs if not isinstance(q, NotCoveredError)] if why is None else why)
    return out


def _made(jobs: Sequence[Job]) -> list[CompiledJob] | NotCoveredError:
    machines: dict[Any, CompiledJob] = {}
    out = []
    try:
        for job in jobs:
            key = (id(job.model), id(job.config))
            out.append(machines[key].of(job) if key in machines else CompiledJob(job))
            machines.setdefault(key, out[-1])
    except NotCoveredError as why:
        return why
    return out


def _seen(compiled: CompiledJob, q: Array) -> Array:
    """At the wanted times, of the angles (rows, n) of all joints."""
    return _read(q[:, compiled.machine.servos.joint] - compiled.physics.zero, _reading(compiled, len(q)))


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
