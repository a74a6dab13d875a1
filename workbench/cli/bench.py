"""`workbench bench`: the figures of the README, measured side by side."""

from __future__ import annotations

import argparse
import json
import os
import platform
from typing import Any

STEP = 1e-3


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "bench",
        help="measure the speeds stated in the README",
        description="Prints as JSON, measured in one run: the station with the full servo law against a bare Drake plant with PD "
        "at the same step, and against MuJoCo at the same joint error; the Motive reader against pandas; 64 rollouts on two "
        "processes against one.",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Measures and prints."""
    from workbench.cli.progress import Progress
    from workbench.motion import load_motion
    from workbench.recording.bench import reader_against_pandas
    from workbench.robot import data_file, puppy_model
    from workbench.simulation import bench

    model = puppy_model()
    walk = load_motion(data_file("robotis_walk.csv"), model)
    machine = {"processor": _processor(), "cores": os.cpu_count(), "python": platform.python_version()}
    figures: dict[str, Any] = {"machine": machine}
    with Progress("bench") as progress:
        progress("station against bare plant")
        race = bench.station_against_bare_plant(model, walk.commands(4), STEP)
        figures["station_against_bare_plant"] = {"step": STEP, "station_seconds": race.first, "bare_seconds": race.second,
                                                 "speed": race.speed}
        progress("station against MuJoCo")
        figures["station_against_mujoco"] = _against_mujoco(model, walk.commands(2))
        progress("Motive reader against pandas")
        figures["motive_reader_against_pandas"] = reader_against_pandas()
        progress("64 rollouts on two processes against one")
        race = bench.batch_on_two_processes(model, walk.commands(3))
        figures["batch_of_64_on_two_processes"] = {"two_seconds": race.first, "one_seconds": race.second, "speed": race.speed}
    print(json.dumps(figures, indent=2))
    return 0


def _against_mujoco(model: Any, commands: Any) -> dict[str, Any]:
    """Real-time factors at the same joint error against each engine's own converged rollout; MuJoCo's fastest step within it."""
    from workbench.simulation import bench

    error = bench.joint_error(model, commands, STEP)
    ours = bench.real_time_factor(model, commands, STEP)
    figures: dict[str, Any] = {"step": STEP, "joint_error_rad": error, "real_time_factor": ours}
    try:
        from studies.other_engine.bench import fastest_within
        from studies.other_engine.bench import race as mujoco_race
    except ImportError as e:
        return figures | {"mujoco": None, "why": f"needs the source tree and its test dependencies ({e})"}
    races = mujoco_race(model, commands, commands.end, repeats=3)
    best = fastest_within(races, error)
    return figures | {"mujoco_step": best.timestep, "mujoco_joint_error_rad": best.error,
                      "mujoco_real_time_factor": best.real_time_factor, "speed": ours / best.real_time_factor}


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as f:
            return next((line.partition(":")[2].strip() for line in f if line.startswith("model name")), platform.machine())
    except OSError:
        return platform.processor() or platform.machine()
