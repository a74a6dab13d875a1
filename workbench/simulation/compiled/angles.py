"""Angles alone of many runs of a held robot, straight from the compiled station: what fits of servo logs ask by the thousand."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.motion.commands import Commands
from workbench.simulation.compiled.arrays import Schedule
from workbench.simulation.compiled.schedule import schedule_of
from workbench.simulation.compiled.station import CompiledJob
from workbench.simulation.job import Job

Array = NDArray[np.float64]
KEPT = 256
"""Schedules of commands that are kept, as a session's takes are played again and again."""
_schedules: OrderedDict[Any, tuple[Commands, Schedule]] = OrderedDict()


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
        time = np.arange(len(log.q)) * compiled.config.logged_every - compiled.plan.lead
        joints = compiled.machine.servos.joint
        out.append(np.column_stack([np.interp(job.times, time, log.q[:, j], left=np.nan, right=np.nan) for j in joints])
                   - compiled.physics.zero)
    return out


def _schedule(compiled: CompiledJob) -> Schedule:
    """Of a job; made once for the same commands."""
    job, plan, config = compiled.job, compiled.plan, compiled.config
    kept = plan.heard_as_sent and job.commands is not None and job.steadied is None
    key = (id(job.commands), replace(config), compiled.model.joints, plan.lead, plan.duration, job.elapsed)
    if kept and key in _schedules:
        return _schedules[key][1]
    schedule = schedule_of(config, plan.commands, plan.lead, plan.duration, job.elapsed, job.steadied)
    if kept:
        assert job.commands is not None
        _schedules[key] = (job.commands, schedule)  # holds the commands, so that their id stays theirs
        while len(_schedules) > KEPT:
            _schedules.popitem(last=False)
    return schedule


