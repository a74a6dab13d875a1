"""Do seeds by trajectory optimisation pay? Twenty tasks: how often they are solved, how long it takes, how their seeds walk.

Each plan becomes a table by the same inverse servo law as any gait, and is played with the full servo law. It is compared with
the best of as many random seeds of the same family as the plan's time would have paid for, and with their median. Then searches
with planned seeds and without: rollouts until they are near the best gait that any of them found.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from studies.common import publish, run_study, sign
from studies.gait_seeds_saved import BUDGET, REQUESTS, Saved, saved
from workbench.gait.certificate import CLAIM
from workbench.gait.evaluate import Evaluator
from workbench.gait.machine import GaitMachine
from workbench.gait.planned import bundled_tasks
from workbench.gait.request import Request, Way
from workbench.gait.search import Budget
from workbench.gait.space import seeds, space_of
from workbench.gait.table import gait_table
from workbench.gait.trajopt import Planned, Task, plan
from workbench.recording.take import Take
from workbench.robot import puppy_model
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.view.figures.joints import joint_overlay
from workbench.view.report.page import Picture, Provenance, Report, Section, Table, Text

RANDOM = 24
"""Random seeds of each task's family and way."""
SHOWN = "trot 0.2 m/s"
QUICK = Budget(seeds=20, starts=1, generations=1, draws=0)
SEARCHES = (0, 1)
"""Seeds of the random generator of the searches with planned seeds and without."""


def request_of(task: Task) -> Request:
    """The request that a task belongs to."""
    forward, left = task.velocity
    if not forward and not left:
        return Request("turn")
    way: Way = "sideways" if left else "backward" if forward < 0 else "arc" if task.turn_rate else "forward"
    return Request(way, radius=forward / task.turn_rate if way == "arc" else None, slope=task.slope)


def asked(task: Task) -> float:
    """Speed of a task in its way [m/s or rad/s]."""
    return abs(task.velocity[0]) or abs(task.velocity[1]) or task.turn_rate


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Plans, plays, compares."""
    machine, rows, plans = GaitMachine(puppy_model()), [], {}
    numbers: dict[str, dict[str, Any]] = {}
    tasks = bundled_tasks()[::7] if quick else bundled_tasks()
    count = 4 if quick else RANDOM
    for k, task in enumerate(tasks):
        progress(f"task {k + 1} of {len(tasks)}: {task.name}", k / len(tasks))
        began = time.process_time()
        planned = plan(machine, task)
        seconds = time.process_time() - began
        request = request_of(task)
        evaluator, space = Evaluator(machine, request, []), space_of(machine, request)
        random = [s for s in seeds(machine, request, space, 12 * count, 1) if s.family == task.shape.family][:count]
        mine, *others = evaluator.judge([planned.shape, *random], 0)
        reached = request.progress(mine.nominal) if mine.nominal else 0.0
        theirs = sorted((request.progress(c.nominal) if c.nominal else 0.0) for c in others)
        fell = sum(c.nominal is None or c.nominal.fell for c in others)
        rows.append([task.name, planned.solver if planned.solved else "not solved", f"{seconds:.1f}", f"{asked(task):.3g}",
                     sign(reached, 3), sign(float(np.median(theirs)), 3), sign(theirs[-1], 3), f"{fell} of {len(others)}"])
        numbers[task.name] = {"solved": planned.solved, "solver": planned.solver, "processor seconds": seconds,
                              "asked": asked(task), "reached": reached, "random median": float(np.median(theirs)),
                              "random best": theirs[-1], "random fallen": fell, "random": len(others)}
        plans[task.name] = planned
    solved = sum(bool(n["solved"]) for n in numbers.values())
    times = [float(n["processor seconds"]) for n in numbers.values()]
    shown = plans.get(SHOWN, next(iter(plans.values())))
    said = f"{solved} of {len(tasks)} tasks solved, {np.median(times):.1f} s of one core each (median)."
    report = Report("Seeds by trajectory optimisation", said, f"{__doc__}\n\n{CLAIM}", [], Provenance.of(machine.model))
    header = ["task", "solver", "processor s", "asked", "its seed walks", "random: median", f"random: best of {count}",
              "random: fell"]
    unit = "m/s, of turns rad/s, in the way asked for; played by the full servo law on the model."
    report.add(Section("Twenty tasks", [Table(header, rows, unit)]))
    asked_for = dict(list(REQUESTS.items())[:1]) if quick else REQUESTS
    searched = {}
    for k, (name, wanted) in enumerate(asked_for.items()):
        progress(f"searches for {name}", k / len(asked_for))
        searched[name] = saved(machine, wanted, SEARCHES[:1] if quick else SEARCHES, QUICK if quick else BUDGET)
    report.add(_savings(searched))
    figure, text = _trajectory(machine, shown)
    caption = "Right middle joint of the front legs: planned, and as the servo follows the table."
    report.add(Section("Planned, tabled, reached", [Text(text), Picture(figure, caption)]))
    return publish(out, machine.model, report, {"tasks": numbers, "solved": solved, "median seconds": float(np.median(times)),
                                                "rollouts until near": {name: asdict(s) for name, s in searched.items()}},
                   {"planned": figure})


def _savings(searched: Mapping[str, Saved]) -> Section:
    def told(counts: Sequence[int | None]) -> str:
        return ", ".join("not reached" if n is None else str(n) for n in counts)

    rows = [[name, f"{s.best:.3f}", told(s.planned), told(s.random)] for name, s in searched.items()]
    header = ["request", "best [m/s]", "with planned seeds", "random seeds alone"]
    said = "On the nominal robot, all limits kept; one search for each seed of the random generator."
    return Section("Rollouts until nine tenths of the best speed", [Table(header, rows, said)])


def _trajectory(machine: GaitMachine, planned: Planned) -> tuple[Figure, str]:
    """The planned angles of one joint, and those of the servos that follow the table, over two cycles."""
    shape = replace(planned.shape, poses=8)
    table = gait_table(machine, shape)
    take = simulate_batch([Job(machine.model, SimulationConfig(), table.commands(4))])[0]
    begin = table.start_seconds + 2 * table.period
    time_ = begin + np.arange(0, 2 * table.period, 0.005)
    phase = ((time_ - begin) / table.period) % 1.0
    knots = np.arange(len(planned.q) + 1) / len(planned.q)
    closed = np.vstack([planned.q, planned.q[:1]])
    q = np.array([np.interp(phase, knots, column) for column in closed.T]).T
    plan_take = Take("planned", "simulation", time_, machine.model.joints, q, starts_at=0.0)
    joint = machine.legs[-1].joints[1]
    real = np.array([np.interp(time_, take.time, column) for column in take.q.T]).T
    off = float(np.degrees(np.sqrt(np.mean((real - q)[:, machine.model.joints.index(joint)] ** 2))))
    text = (f"{planned.task.name}, joint {joint}: the servo is {off:.1f} deg (RMS) from the planned angles over two cycles; a "
            f"table of {shape.poses} poses cannot hold more than the path's corners.")
    return joint_overlay(joint, take, plan_take, span=(begin, begin + 2 * table.period)), text


if __name__ == "__main__":
    raise SystemExit(run_study("gait_seeds", __doc__, study))
