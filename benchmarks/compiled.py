"""Speed of the compiled station: per step against Drake, at equal joint error against MuJoCo, and on two threads against one."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from benchmarks.drives import LEAD, joint_error
from benchmarks.figure import Figure, in_turns, median_and_quartiles
from workbench.motion import Commands
from workbench.recording import Take
from workbench.robot import RobotModel
from workbench.simulation.batch import run_job, simulate_batch
from workbench.simulation.compiled import NotCoveredError
from workbench.simulation.config import SimulationConfig
from workbench.simulation.job import Job

HELD, WALKING = 50.0, 25.0
"""Required speed of a compiled step over Drake's, with the base held and free."""
OVER_MUJOCO = {"fixed": 4.0, "free": 2.0}
"""Required real-time factor over MuJoCo's, by base."""
SETTLING = 1e-3
"""Duration [s] of a run with hardly any steps, which gives the fixed cost of a job."""


def compiled_against_drake(model: RobotModel, commands: Commands, duration: float, step: float, repeats: int) -> list[Figure]:
    """Processor time per step of Drake's jobs over that of the same jobs in the compiled station: base held, standing on the
    floor, and walking. The fixed cost of a job is subtracted from both."""
    still = replace(commands, goals=0.2 * commands.goals)
    cases = {"held": ("fixed", commands, HELD), "standing": ("free", still, WALKING), "walking": ("free", commands, WALKING)}
    return [_step_ratio(model, name, base, played, duration, step, repeats, least)
            for name, (base, played, least) in cases.items()]


def _step_ratio(model: RobotModel, name: str, base: str, commands: Commands, duration: float, step: float, repeats: int,
                least: float) -> Figure:
    figure, meaning = f"compiled_against_drake_{name}", f"speed of a compiled step over Drake's, {name}"
    config = SimulationConfig(time_step=step, base=base, contact_period=0.0)
    job = Job(model, config, commands, duration, LEAD, times=np.zeros(1))
    try:
        jobs = {f"{engine} {length}": _by(engine, replace(job, duration=d))
                for engine in ("drake", "compiled") for length, d in (("whole", duration), ("none", SETTLING))}
        seconds = in_turns({n: lambda j=j: run_job(j) for n, j in jobs.items()}, repeats)  # type: ignore[misc]
    except NotCoveredError as why:
        return Figure(figure, meaning, skipped=str(why))
    steps = (duration - SETTLING) / step
    each = {engine: (seconds[f"{engine} whole"] - seconds[f"{engine} none"]) / steps for engine in ("drake", "compiled")}
    value, quartiles = median_and_quartiles(each["drake"] / each["compiled"])
    return Figure(figure, meaning, value, quartiles, at_least=least, details={
        "step_seconds": step, "turns": repeats, "microseconds_per_step": {e: float(np.median(s)) * 1e6 for e, s in each.items()},
        "milliseconds_of_a_job_without_steps": {e: float(np.median(seconds[f"{e} none"])) * 1e3 for e in each}})


def compiled_against_mujoco(model: RobotModel, commands: Commands, duration: float, exact: Take, finest: float, step: float,
                            repeats: int) -> Figure:
    """Like `engine.station_against_mujoco`, but for the compiled station and for whole jobs, including building and settling."""
    base = exact.base
    name = f"compiled_against_mujoco_{base}_base"
    meaning = (f"real-time factor of the compiled station over MuJoCo's at the same joint error, base {base}; both with the full "
               "servo law")
    try:
        from benchmarks.engine import STEPS
        from studies.other_engine.bench import NativePlayer, fastest_within, race
    except ImportError as e:
        return Figure(name, meaning, skipped=f"MuJoCo's robot is in the source tree and its development dependencies ({e})")
    job = _by("compiled", Job(model, SimulationConfig(time_step=step, base=base, contact_period=0.0), commands, duration, LEAD))
    (error,) = joint_error([run_job(job)], exact)
    try:
        best = fastest_within(race(model, commands, duration, base, [s for s in STEPS if s > finest], finest, repeats=1), error)
    except ValueError as e:
        return Figure(name, meaning, skipped=str(e))
    player = NativePlayer(model, commands, duration, base, best.timestep)
    seconds = in_turns({"compiled": lambda: run_job(job), "mujoco": player.run}, repeats)
    factors = {"compiled": (duration + LEAD) / seconds["compiled"], "mujoco": duration / seconds["mujoco"]}
    value, quartiles = median_and_quartiles(factors["compiled"] / factors["mujoco"])
    return Figure(name, meaning, value, quartiles, at_least=OVER_MUJOCO[base], details={
        "joint_error_deg": {"compiled": float(np.degrees(error)), "mujoco": float(np.degrees(best.error))},
        "step_seconds": {"compiled": step, "mujoco": best.timestep}, "turns": repeats,
        "real_time_factor": {k: float(np.median(f)) for k, f in factors.items()}})


def batch_on_two_threads(model: RobotModel, commands: Commands, duration: float, rollouts: int, repeats: int, seed: int
                         ) -> Figure:
    """Wall time of compiled rollouts of the walk, each with a different amplitude."""
    config = SimulationConfig(contact_period=0.0)
    amplitudes = np.random.default_rng(seed).uniform(0.8, 1.0, rollouts)
    times = np.arange(0.0, duration, 1 / 120)
    jobs = [_by("compiled", Job(model, config, replace(commands, goals=a * commands.goals), duration, LEAD, times=times))
            for a in amplitudes]
    runs = {"one": lambda: simulate_batch(jobs, 1), "two": lambda: simulate_batch(jobs, 2)}
    seconds = in_turns(runs, repeats, time.perf_counter)
    value, quartiles = median_and_quartiles(seconds["one"] / seconds["two"])
    return Figure("batch_on_two_threads", f"speed of {rollouts} compiled rollouts on two threads over one", value, quartiles,
                  at_least=1.8, details={"rollouts": rollouts, "simulated_seconds_each": duration + LEAD, "turns": repeats,
                                         "seconds": {n: float(np.median(s)) for n, s in seconds.items()}})


def _by(engine: str, job: Job) -> Job:
    return replace(job, config=replace(job.config, engine=engine))
