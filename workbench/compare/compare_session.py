"""Every take of a session against the nominal robot."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from workbench.compare.comparison import Noise, compare_takes, noise_of
from workbench.compare.options import COMPARE
from workbench.compare.results import Comparison, TakeComparison
from workbench.compare.session import Session
from workbench.compare.session_takes import ReadTake, RegisteredTake, read_takes, register_takes
from workbench.motion.commands import Commands
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig, Start
from workbench.simulation.batch import Job, simulate_batch
from workbench.simulation.compiled import covers
from workbench.simulation.steady import BaseStates
from workbench.types import Array, Progress, no_progress


@dataclass(frozen=True)
class Rollouts:
    """The rollouts of one take: as configured, with the step halved and then quartered, with the other contact model."""

    nominal: Take
    finer: tuple[Take, ...] = ()
    other_contact: tuple[Take, ...] = ()


@dataclass(frozen=True)
class Run:
    """One simulation. start: initial state, if not at rest in neutral; steadied: states to which its base is reset."""

    name: str
    model: RobotModel
    commands: Commands | None
    duration: float
    base: str
    start: Start | None = None
    steadied: BaseStates | None = None


def compare_session(session: Session, config: SimulationConfig | None = None, *, progress: Progress = no_progress,
                    n_jobs: int = 2, finer_steps: Literal["judged", "drake"] = "judged") -> Comparison:
    """Simulates, registers and compares every take. config: of the nominal rollout, its base set by each take; by default
    Drake's. finer_steps: "judged" computes the finer steps of the numerical floor with the compiled station, if that agrees with
    Drake at the nominal step; else Drake computes them all. A damaged take is left out and named in the result; InputError if
    none remains. The rollouts of all takes, steps and contact models are spread over `n_jobs` processes. progress: called with
    (what, share done or None).
    """
    began = time.monotonic()
    config = config or SimulationConfig(engine="drake")
    progress("reading recordings", None)
    takes, unreadable = read_takes(session)
    rolled = roll_out_judged if finer_steps == "judged" and config.engine == "drake" else roll_out
    rollouts = rolled([run_of(t) for t in takes], config, progress=progress, n_jobs=n_jobs)
    nominal = {t.spec.name: r.nominal for t, r in zip(takes, rollouts)}
    registered, unregistered = register_takes(session, takes, nominal, progress)
    by_name = dict(zip(nominal, rollouts))
    noise = noise_of([t.recorded for t in registered])
    compared = []
    for i, t in enumerate(registered):
        progress(f"comparing {t.spec.name}", i / len(registered))
        compared.append(_compare(t, by_name[t.spec.name], noise))
    return Comparison(tuple(compared), unreadable + unregistered, provenance(session.model, config, time.monotonic() - began))


def roll_out(runs: Sequence[Run], config: SimulationConfig, *, progress: Progress = no_progress, n_jobs: int = 2,
             floors: bool = True, finer: bool = True) -> list[Rollouts]:
    """Simulates each run; with `floors` also at finer steps (unless not `finer`) and, where the robot stands on the ground, with
    the other contact."""
    jobs: list[tuple[int, str, Job]] = []
    for i, run in enumerate(runs):
        own = replace(config, base=run.base)
        variants = {"nominal": [own], "finer": [], "other_contact": []}
        if floors and finer:
            variants["finer"] = _finer(own)
        if floors and run.base == "free":
            variants["other_contact"] = [replace(own, contact="point" if own.contact == "hydroelastic" else "hydroelastic")]
        jobs += [(i, kind, _job(run, c, _instants(run, own) if kind == "finer" else None))
                 for kind, configs in variants.items() for c in configs]
    progress("simulating", 0.0)
    done = _longest_first([job for *_, job in jobs], n_jobs, lambda n, of: progress("simulating", n / of))
    out = []
    for i in range(len(runs)):
        mine: dict[str, list[Take]] = {"nominal": [], "finer": [], "other_contact": []}
        for (of, kind, _), take in zip(jobs, done):
            if of == i:
                mine[kind].append(take)
        out.append(Rollouts(mine["nominal"][0], tuple(mine["finer"]), tuple(mine["other_contact"])))
    return out


def roll_out_judged(runs: Sequence[Run], config: SimulationConfig, *, n_jobs: int, progress: Progress = no_progress
                    ) -> list[Rollouts]:
    """The same as `roll_out`, except that the compiled station computes the finer steps of each run in which it supports the
    nominal step and agrees with Drake there."""
    done = roll_out(runs, config, progress=progress, n_jobs=n_jobs, finer=False)
    progress("simulating finer steps", None)
    nominal = [_job(run, replace(config, base=run.base, engine="auto")) for run in runs]
    known = [i for i, job in enumerate(nominal) if _finer(job.config) and covers(job) is None]
    takes = zip(known, simulate_batch([nominal[i] for i in known], n_jobs))
    judged = {i for i, take in takes if _apart(take, done[i].nominal) < COMPARE.engines_apart}
    jobs = [(i, _job(run, c, _instants(run, c))) for i, run in enumerate(runs)
            for c in _finer(replace(config, base=run.base, engine="auto" if i in judged else config.engine))]
    finer: dict[int, list[Take]] = {}
    for (i, _), take in zip(jobs, _longest_first([job for _, job in jobs], n_jobs)):
        finer.setdefault(i, []).append(take)
    return [replace(r, finer=tuple(finer.get(i, ()))) for i, r in enumerate(done)]


def _longest_first(jobs: Sequence[Job], n_jobs: int, progress: Callable[[int, int], None] | None = None) -> list[Take]:
    """The takes in the order of the jobs. The longest jobs are started first, so that no core waits for one at the end."""
    order = sorted(range(len(jobs)), key=lambda k: -_cost(jobs[k]))
    done = dict(zip(order, simulate_batch([jobs[k] for k in order], n_jobs, progress)))
    return [done[k] for k in range(len(jobs))]


def _job(run: Run, config: SimulationConfig, times: Array | None = None) -> Job:
    return Job(run.model, config, run.commands, run.duration, COMPARE.lead, name=run.name, start=run.start, steadied=run.steadied,
               times=times)


def _finer(config: SimulationConfig) -> list[SimulationConfig]:
    """The run at half and at a quarter of the step, with the same output times."""
    if config.time_step <= 0:
        return []
    return [replace(config, time_step=config.time_step / k, log_period=config.logged_every) for k in (2, 4)]


def _apart(one: Take, other: Take) -> float:
    """The largest difference of two rollouts' angles and base positions [rad, m]; infinite where their shapes differ."""
    pairs = [(one.q, other.q), *([] if one.p_WB is None or other.p_WB is None else [(one.p_WB, other.p_WB)])]
    if any(a.shape != b.shape for a, b in pairs):
        return np.inf
    return max(float(np.max(np.abs(a - b), initial=0.0)) for a, b in pairs)


def _instants(run: Run, config: SimulationConfig) -> Array | None:
    """The log's instants, if angles alone determine the floor, as for a held robot: without torques, the compiled station also
    supports servos that are switched off."""
    if run.base != "fixed" or run.duration is None:
        return None
    lead = 0.0 if run.start is not None else COMPARE.lead
    rows = np.arange(-round(lead / config.logged_every), math.floor(run.duration / config.logged_every + 1e-6) + 1)
    return np.asarray(rows * config.logged_every, dtype=float)


def provenance(model: RobotModel, config: SimulationConfig, seconds: float) -> dict[str, Any]:
    """The versions, model, seed and options behind a result."""
    from dataclasses import asdict
    from importlib.metadata import version

    return {"workbench": version("drake-workbench"), "drake": version("drake"), "model_sha256": model.sha256,
            "config": asdict(config), "seconds": round(seconds, 1)}


def _cost(job: Job) -> float:
    """Number of steps; hydroelastic contact counts double, as it takes about twice as long."""
    steps = (job.duration or 0.0) / (job.config.time_step or 1e-4)
    return steps * (2 if job.config.contact == "hydroelastic" else 1)


def run_of(t: ReadTake, steadied: BaseStates | None = None) -> Run:
    """The simulation of a take, with the base reset to the `steadied` states where given."""
    return Run(t.spec.name, t.model, t.commands, t.duration, t.spec.base, t.start_state(), steadied)


def _compare(t: RegisteredTake, rollouts: Rollouts, noise: Noise) -> TakeComparison:
    compared = compare_takes(
        t.recorded, t.observe(rollouts.nominal), t.model, finer=[t.observe(r) for r in rollouts.finer],
        other_contact=[t.observe(r) for r in rollouts.other_contact], noise=noise)
    return replace(compared, starts_at_sigma=t.measurement.starts_at_sigma)
