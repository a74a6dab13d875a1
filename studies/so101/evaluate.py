"""Errors of models and of the plain baseline on programmes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from studies.so101.programmes import Programme
from workbench.compare.session import Session
from workbench.compare.session_takes import read_takes
from workbench.recording.formats.sage import JOINTS
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig
from workbench.simulation.batch import Job, simulate_batch
from workbench.types import Array, Progress

Paths = dict[str, Array]
"""By programme: positions (N, 6) at the recorded times, JOINTS' order; degrees of the servo in what `degrees` gives."""
STEP = 4e-3
"""Of these rollouts [s]; 1 ms moves the nominal errors over 40 s of three training programmes by 0.03 deg at most."""


def simulate(session: Session, model: RobotModel, progress: Progress, what: str, n_jobs: int = 2, step: float = STEP,
             seconds: float | None = None) -> Paths:
    """Positions that a model says of each take of a session, from the recorded start."""
    takes, _ = read_takes(session)
    config = SimulationConfig(time_step=step, base="fixed", contact_period=0.0, settle=0.1)
    jobs = [Job(model, config, t.commands, min(t.duration, seconds or np.inf), 0.0, name=t.spec.name, start=t.start_state(),
                times=t.recording.time[t.recording.time <= min(t.duration, seconds or np.inf) - step]) for t in takes]
    out = {}
    for t, take in zip(takes, simulate_batch(jobs, n_jobs, lambda n, of: progress(what, n / of))):
        q = take.as_logged().q[:, [take.column(j) for j in JOINTS]]
        path = np.full((len(t.recording.time), len(JOINTS)), np.nan)
        path[:len(q)] = q
        out[t.spec.name] = path
    return out


def degrees(scale: float) -> Array:
    """Servo degrees for a recorded unit (6,); scale: the jaw's range [rad]."""
    return np.degrees(np.where(np.array(JOINTS) == "Jaw", scale, 1.0))


def errors(programmes: Sequence[Programme], paths: Mapping[str, Array], unit: Array) -> Array:
    """RMS error (programmes, 6) [deg of the servo]."""
    return np.array([np.sqrt(np.nanmean(np.square((p.read - paths[p.name]) * unit), axis=0)) for p in programmes])


def together(each: Array, programmes: Sequence[Programme]) -> Array:
    """RMS over all programmes (6,), every frame with the same weight."""
    n = np.array([len(p.time) for p in programmes])[:, None]
    return np.asarray(np.sqrt((np.square(each) * n).sum(axis=0) / n.sum()))
