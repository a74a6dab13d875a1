"""The study's models on the station (Drake), take by take."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench.compare.session import Session
from workbench.compare.session_takes import read_takes
from workbench.robot import EffectSpec, RobotModel
from workbench.simulation import Job, SimulationConfig, simulate_batch

DIAGNOSED = "model.yaml"
"""Where a session's folder keeps what `workbench diagnose` made of it."""
STATION = SimulationConfig(base="fixed", contact_period=0)


def station_errors(session: Session, model: RobotModel, gain: int, n_jobs: int = 1) -> dict[str, float]:
    """Mean absolute error [rad] of a model on a session's takes at one gain, by name, each from its measured start."""
    read = [t for t in read_takes(session)[0] if t.spec.name.endswith(f"_{gain}")]
    jobs = []
    for t in read:
        assert t.commands is not None
        since = t.recording.time - t.recording.time[0]
        own = replace(model.with_servos(t.spec.servos), effects=model.effects)
        jobs.append(Job(own, STATION, t.commands, float(since[-1]) + 2e-3, start=t.start_state(), times=since, name=t.spec.name))
    out = {}
    for t, rollout in zip(read, simulate_batch(jobs, n_jobs)):
        position = t.recording.channels[f"position.{t.model.joints[0]}"]
        out[t.spec.name] = float(np.nanmean(np.abs(rollout.as_logged().q[:, 0] - position)))
    return out


def with_specs(session: Session, effects: tuple[EffectSpec, ...]) -> RobotModel:
    """The nominal rig with effects."""
    return replace(session.model, effects=effects)

