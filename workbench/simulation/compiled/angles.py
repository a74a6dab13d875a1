"""Angles alone of many runs of a held robot, straight from the compiled station: what fits of servo logs ask by the thousand."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from workbench.motion.commands import Commands
from workbench.simulation.compiled.arrays import Schedule
from workbench.simulation.compiled.schedule import schedule_of
from workbench.simulation.compiled.station import CompiledJob
from workbench.simulation.job import Job
from workbench.simulation.steady import JointStates
from workbench.types import Array

KEPT = 256
"""Schedules of commands that are kept, as a session's takes are played again and again."""
_schedules: OrderedDict[Any, tuple[Commands, JointStates | None, Schedule]] = OrderedDict()


def servo_angles(jobs: Sequence[Job]) -> list[Array]:
    """Of each job the angles (M, n) [rad] of the servos at its `times`, as their own sensors tell them, NaN outside the run.
    Jobs of one model share what is made of it. NotCoveredError says why a job has to be Drake's."""
    machines: dict[Any, CompiledJob] = {}
    out = []
    for job in jobs:
        key = (id(job.model), id(job.config))
        compiled = machines[key].of(job) if key in machines else CompiledJob(job)
        machines.setdefault(key, compiled)
        log = compiled.log(_schedule(compiled))
        assert job.times is not None
        every = compiled.config.logged_every
        time = np.arange(len(log.q)) * every - compiled.plan.lead
        joints = compiled.machine.servos.joint
        told = np.column_stack([np.interp(job.times, time, log.q[:, j], left=np.nan, right=np.nan) for j in joints])
        angles = told - compiled.physics.zero
        if job.restarts is not None:
            rows = log.q[:, joints] - compiled.physics.zero
            _from_where_put(angles, job.times, np.asarray(time, dtype=float), rows, job.restarts)
        out.append(angles)
    return out


def _from_where_put(angles: Array, times: Array, time: Array, rows: Array, restarts: JointStates) -> None:
    """Corrects angles (M, n) right after a restart, where the log's row is of the robot as it came there. time, rows: of the
    log."""
    k = np.searchsorted(time, times, side="left")  # the row at or after each time
    at = np.round(restarts.times / (time[1] - time[0])).astype(int) - round(time[0] / (time[1] - time[0]))
    for row, q in zip(at.tolist(), restarts.q):
        here = np.flatnonzero((k == row + 1) & (k < len(time)))
        if len(here):
            share = ((times[here] - time[row]) / (time[row + 1] - time[row]))[:, None]
            angles[here] = np.where(np.isnan(q), angles[here], q + share * (rows[row + 1] - q))


def _schedule(compiled: CompiledJob) -> Schedule:
    """Of a job; made once for the same commands."""
    job, plan, config = compiled.job, compiled.plan, compiled.config
    kept = plan.heard_as_sent and job.commands is not None and job.steadied is None
    key = (id(job.commands), replace(config), compiled.model.joints, plan.lead, plan.duration, job.elapsed, id(job.restarts))
    if kept and key in _schedules:
        return _schedules[key][2]
    schedule = schedule_of(config, plan.commands, plan.lead, plan.duration, job.elapsed, job.steadied, job.restarts)
    if kept:
        assert job.commands is not None
        _schedules[key] = (job.commands, job.restarts, schedule)  # holds them, so that their ids stay theirs
        while len(_schedules) > KEPT:
            _schedules.popitem(last=False)
    return schedule


