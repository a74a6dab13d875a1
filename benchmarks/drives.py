"""Speed of the station: against a bare Drake plant, with the fast servo law and larger steps, and on two processes."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from benchmarks.bare_plant import BarePlant
from benchmarks.figure import Figure, in_turns, median_and_quartiles
from workbench.motion import Commands
from workbench.recording import Take
from workbench.robot import RobotModel
from workbench.simulation.batch import Job, simulate_batch
from workbench.simulation.config import SimulationConfig
from workbench.simulation.rollout import Simulation

LEAD = 0.1
"""Simulated rest before the first command [s]."""


def station_against_bare_plant(model: RobotModel, commands: Commands, duration: float, step: float, repeats: int) -> list[Figure]:
    """Speed of the station with the full servo law and its logs, with and without sampled contact forces."""
    stations = {"station": Simulation(model, SimulationConfig(time_step=step, contact_period=0.0)),
                "with_forces": Simulation(model, SimulationConfig(time_step=step))}
    take = stations["station"].run(commands, duration, LEAD)
    runs = {"bare": BarePlant(model, commands, take, step).run}
    runs |= {name: lambda s=s: s.run(commands, duration, LEAD) for name, s in stations.items()}  # type: ignore[misc]
    seconds = in_turns(runs, repeats)
    steps = round((duration + LEAD) / step)
    details = {"step_seconds": step, "simulated_seconds": duration + LEAD, "turns": repeats,
               "microseconds_per_step": {name: float(np.median(s)) / steps * 1e6 for name, s in seconds.items()}}
    meaning = "speed of the station with the full servo law over that of the bare plant with Drake's PD on the same motion"
    value, quartiles = median_and_quartiles(seconds["bare"] / seconds["station"])
    forces, forces_quartiles = median_and_quartiles(seconds["bare"] / seconds["with_forces"])
    return [Figure("station_against_bare_plant", meaning, value, quartiles, at_least=0.7, aim=0.95, details=details),
            Figure("station_with_contact_forces_against_bare_plant", f"{meaning}, contact forces sampled at 120 Hz", forces,
                   forces_quartiles, at_least=0.7, aim=0.95)]


def joint_error(takes: Iterable[Take], exact: Take) -> list[float]:
    """RMS difference [rad] of each take's joint angles from those of `exact`, from the first command on."""
    out = []
    for take in takes:
        moving = take.time >= 0
        finer = np.column_stack([np.interp(take.time[moving], exact.time, column) for column in exact.q.T])
        out.append(float(np.sqrt(np.mean(np.square(take.q[moving] - finer)))))
    return out


def converged(model: RobotModel, commands: Commands, duration: float, base: str, step: float) -> Take:
    """A rollout with the full servo law at a step so fine that its motion counts as exact."""
    return Simulation(model, SimulationConfig(time_step=step, base=base, contact_period=0.0)).run(commands, duration, LEAD)


def fast_servo_and_larger_steps(model: RobotModel, commands: Commands, duration: float, exact: Take, repeats: int) -> Figure:
    """Speed and joint error of the full and the fast servo law at 1, 2 and 4 ms; the base is held, so that errors do not grow."""
    configs = {f"{drive} at {1e3 * step:g} ms": SimulationConfig(time_step=step, base="fixed", drive=drive)
               for drive in ("servo", "fast_servo") for step in (1e-3, 2e-3, 4e-3)}
    stations = {name: Simulation(model, config) for name, config in configs.items()}
    errors = joint_error([s.run(commands, duration, LEAD) for s in stations.values()], exact)
    seconds = in_turns({name: lambda s=s: s.run(commands, duration, LEAD) for name, s in stations.items()},  # type: ignore[misc]
                       repeats)
    full = seconds["servo at 1 ms"]
    rows = {name: {"speed": median_and_quartiles(full / seconds[name])[0], "joint_error_deg": float(np.degrees(error))}
            for name, error in zip(stations, errors)}
    meaning = "speed of the fastest of these over the full servo law at 1 ms; joint errors are against the full law, converged"
    return Figure("fast_servo_and_larger_steps", meaning, max(row["speed"] for row in rows.values()), details=rows)


def batch_on_two_processes(
    model: RobotModel, commands: Commands, duration: float, rollouts: int, repeats: int, seed: int
) -> Figure:
    """Wall time of rollouts of the walk, each with a different amplitude."""
    config = SimulationConfig(engine="drake")
    amplitudes = np.random.default_rng(seed).uniform(0.8, 1.0, rollouts)
    jobs = [Job(model, config, replace(commands, goals=a * commands.goals), duration, LEAD) for a in amplitudes]
    began = time.perf_counter()
    simulate_batch(jobs, 2)
    first = time.perf_counter() - began
    simulate_batch(jobs[:1], 1)
    runs = {"one": lambda: simulate_batch(jobs, 1), "two": lambda: simulate_batch(jobs, 2)}
    seconds = in_turns(runs, repeats, time.perf_counter, warm=False)
    value, quartiles = median_and_quartiles(seconds["one"] / seconds["two"])
    return Figure(
        "batch_on_two_processes", f"speed of {rollouts} rollouts on two processes over one, stations built and processes running",
        value, quartiles, at_least=1.7,
        details={"rollouts": rollouts, "simulated_seconds_each": duration + LEAD, "turns": repeats,
                 "seconds": {name: float(np.median(s)) for name, s in seconds.items()},
                 "with_start_of_processes_and_building": {"seconds": first, "speed": float(np.median(seconds["one"])) / first}})
