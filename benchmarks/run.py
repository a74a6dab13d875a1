"""Measures all figures in one run and describes the machine they were measured on."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from benchmarks import compiled, drives, engine, reader
from benchmarks.captured import captured_against_observed
from benchmarks.diagnose_time import diagnose_time
from benchmarks.figure import Figure
from benchmarks.servo_logs import servo_log_rollouts
from benchmarks.sysid import fit_against_mujoco_sysid
from workbench.motion import load_motion
from workbench.robot import data_file, puppy_model

STEP = 1e-3
SEED = 0
CYCLES = 4
PACKAGES = ("drake", "mujoco", "numpy", "pandas", "pyarrow", "joblib", "numba")


@dataclass(frozen=True)
class Size:
    """How much is measured. duration, walk: of the motion with the base held and of the walk [s]. turns: of each comparison.
    finest: step whose motion counts as exact [s]. frames, readings: length of the Motive file, and how often it is read.
    rollouts, batches: in a batch, and how many batches."""

    duration: float = 1.5
    walk: float = 0.5
    turns: int = 9
    finest: float = 1e-4
    frames: int = 72_000
    readings: int = 7
    rollouts: int = 64
    batches: int = 3


QUICK = Size(duration=0.1, walk=0.1, turns=1, finest=5e-4, frames=2000, readings=1, rollouts=4, batches=1)
"""Only checks that everything runs; the figures mean nothing."""


LOG, LOG_QUICK, LOG_DIAGNOSED = 4.0, 0.3, 2.4
"""Duration of the log that is fitted, also in the quick form, and of the one that is diagnosed [s]."""
TURNS = 2
MODELS, LOG_TURNS = 50, 5
CAPTURED, CAPTURED_QUICK = (5.0, 7), (1.1, 1)
"""Length of the take [s] and turns of rollouts of captured takes, also in the quick form."""


def run_bench(quick: bool = False, progress: Callable[[str], None] = lambda what: None) -> dict[str, Any]:
    """Measures every figure on the puppy's walk, then what fits cost, and returns the JSON of `workbench bench`."""
    began, load = time.perf_counter(), os.getloadavg()[0]
    figures = _measure(QUICK if quick else Size(), progress) + _fits(quick, progress)
    warnings = ["quick: too little was measured for the figures to mean anything"] if quick else []
    if load > 1:
        warnings.append(f"load average {load:.1f} at the start: other work distorts the figures in wall time, the batch "
                        "and the reader")
    return {"format": 1, "quick": quick, "machine": _machine(load), "versions": _versions(), "seed": SEED, "warnings": warnings,
            "figures": {f.name: f.to_json() for f in figures}, "seconds": time.perf_counter() - began}


def _measure(size: Size, progress: Callable[[str], None]) -> list[Figure]:
    model = puppy_model()
    walk = load_motion(data_file("robotis_walk.csv"), model).commands(CYCLES)
    progress("batch of rollouts on two processes against one")  # first, while no worker process is up
    batch = drives.batch_on_two_processes(model, walk, size.walk, size.rollouts, size.batches, SEED)
    progress("compiled rollouts on two threads against one")
    threads = compiled.batch_on_two_threads(model, walk, size.walk, size.rollouts, size.batches, SEED)
    progress("compiled steps against Drake's")
    steps = compiled.compiled_against_drake(model, walk, size.duration, STEP, size.turns)
    progress("station against bare plant")
    figures = drives.station_against_bare_plant(model, walk, size.duration, STEP, size.turns)
    for base, duration in (("fixed", size.duration), ("free", size.walk)):
        progress(f"station against MuJoCo, base {base}")
        exact = drives.converged(model, walk, duration, base, size.finest)
        figures.append(engine.station_against_mujoco(model, walk, duration, exact, size.finest, STEP, size.turns))
        figures.append(compiled.compiled_against_mujoco(model, walk, duration, exact, size.finest, STEP, size.turns))
    progress("fast servo and larger steps")
    exact = drives.converged(model, walk, size.duration, "fixed", size.finest)
    figures.append(drives.fast_servo_and_larger_steps(model, walk, size.duration, exact, size.turns))
    progress("Motive reader against pandas")
    return [*steps, *figures, threads, reader.reader_against_pandas(size.frames, size.readings, SEED), batch]


def _fits(quick: bool, progress: Callable[[str], None]) -> list[Figure]:
    progress("fit against MuJoCo's system identification")
    fit = fit_against_mujoco_sysid(LOG_QUICK, 1, SEED, iterations=1) if quick else fit_against_mujoco_sysid(LOG, TURNS, SEED)
    progress("rollouts of a servo log against MuJoCo's")
    logs = (servo_log_rollouts(LOG_QUICK, 2, 1, SEED) if quick
            else servo_log_rollouts(LOG, MODELS, LOG_TURNS, SEED))
    progress("rollouts of captured takes")
    captured = captured_against_observed(*(CAPTURED_QUICK if quick else CAPTURED))
    progress("where a diagnosis spends its time")
    return [fit, *logs, *captured, diagnose_time(None if quick else LOG_DIAGNOSED, SEED)]


def _machine(load: float) -> dict[str, Any]:
    return {"processor": _processor(), "cores": os.cpu_count(), "system": platform.platform(), "load_average_at_start": load}


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as f:
            return next((line.partition(":")[2].strip() for line in f if line.startswith("model name")), platform.machine())
    except OSError:
        return platform.processor() or platform.machine()


def _versions() -> dict[str, str]:
    out = {"workbench": version("drake-workbench"), "python": platform.python_version()}
    for package in PACKAGES:
        try:
            out[package] = version(package)
        except PackageNotFoundError:
            continue
    return out
