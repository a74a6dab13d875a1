"""Models on the station (Drake), take by take."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from workbench.compare.session import Session
from workbench.compare.session_takes import read_takes
from workbench.robot import RobotModel
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.types import Array

STATION = SimulationConfig(base="fixed", contact_period=0)


@dataclass(frozen=True)
class Played:
    """One log played by a model from its measured start. time (N,) [s]; recorded, simulated (N,) [rad]."""

    time: Array
    recorded: Array
    simulated: Array

    @property
    def error(self) -> float:
        """Mean absolute error [rad]."""
        return float(np.nanmean(np.abs(self.simulated - self.recorded)))


def played(session: Session, model: RobotModel, gain: int, n_jobs: int = 1) -> dict[str, Played]:
    """A session's takes at one gain, by name."""
    read = [t for t in read_takes(session)[0] if t.spec.name.endswith(f"_{gain}")]
    jobs = []
    for t in read:
        assert t.commands is not None
        since = t.recording.time - t.recording.time[0]
        own = replace(model.with_servos(t.spec.servos), effects=model.effects)
        jobs.append(Job(own, STATION, t.commands, float(since[-1]) + 2e-3, start=t.start_state(), times=since, name=t.spec.name))
    return {t.spec.name: Played(job.times, t.recording.channels[f"position.{t.model.joints[0]}"], rollout.as_logged().q[:, 0])
            for t, job, rollout in zip(read, jobs, simulate_batch(jobs, n_jobs)) if job.times is not None}


def mean_error(of: Mapping[str, Played]) -> float:
    """Over logs [rad]."""
    return float(np.mean([p.error for p in of.values()]))
