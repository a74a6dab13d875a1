"""Planned joint paths as tables: what share of the planned speed does each of twenty tasks reach?

Each programme's own joint path becomes a table through the inverse servo law, is trimmed straight, and is played by the nominal
robot with the full servo law. A task counts as reached where the robot stays on its feet with nine tenths of the planned speed.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from studies.common import publish, run_study, sign
from studies.gait_seeds import asked, request_of
from workbench.gait.certificate import CLAIM
from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.limits import binding
from workbench.gait.machine import GaitMachine
from workbench.gait.planned import bundled_tasks, table_shape
from workbench.gait.search import steer
from workbench.gait.space import space_of
from workbench.gait.trajopt import Task, plan
from workbench.robot import puppy_model
from workbench.view.report.page import Provenance, Report, Section, Table

REACHED = 0.9
"""Share of the planned speed from which a task is reached."""


def played(machine: GaitMachine, task: Task) -> tuple[Candidate | None, bool, float, float]:
    """Of a task: its table on the nominal robot (None where the programme is not solved), whether it was solved, processor time
    of the programme [s], and speed in the planned way [m/s, for a turn rad/s]."""
    began = time.process_time()
    planned = plan(machine, task)
    seconds = time.process_time() - began
    if not planned.solved:
        return None, False, seconds, 0.0
    request = request_of(task)
    evaluator = Evaluator(machine, request, [], n_jobs=1)
    (walked,) = steer(evaluator, space_of(machine, request), evaluator.judge([table_shape(machine, planned)], 0))
    return walked, True, seconds, request.progress(walked.nominal) if walked.nominal else 0.0


def study(out: Path, quick: bool, progress: Callable[[str, float | None], None]) -> str:
    """Plans, makes tables, plays them."""
    machine, rows = GaitMachine(puppy_model()), []
    numbers: dict[str, dict[str, Any]] = {}
    tasks = bundled_tasks()[::7] if quick else bundled_tasks()
    for k, task in enumerate(tasks):
        progress(f"task {k + 1} of {len(tasks)}: {task.name}", k / len(tasks))
        walked, solved, seconds, speed = played(machine, task)
        share = float(speed / asked(task))
        limit = None if walked is None else binding(m for m in walked.margins if m.kind != "speed")
        broken = "" if walked is None or walked.good or limit is None else str(limit)
        numbers[task.name] = {"solved": solved, "processor seconds": seconds, "planned": float(asked(task)),
                              "reached": float(speed), "share": share, "breaks": broken}
        rows.append([task.name, "yes" if solved else "no", f"{seconds:.1f}", f"{asked(task):.3g}", sign(speed, 3),
                     f"{100 * share:.0f} %", broken or "nothing"])
    reached = sum(1 for n in numbers.values() if n["share"] >= REACHED)
    shares = [n["share"] for n in numbers.values()]
    said = (f"{reached} of {len(tasks)} tasks reach {100 * REACHED:.0f} % of the planned speed; median share "
            f"{100 * float(np.median(shares)):.0f} %.")
    report = Report("Planned paths as tables", said, f"{__doc__}\n\n{CLAIM}", [], Provenance.of(machine.model))
    header = ["task", "solved", "processor s", "planned", "reached", "share", "limit that it breaks most"]
    report.add(Section("Twenty tasks", [Table(header, rows, "m/s, of turns rad/s, on the nominal robot.")]))
    return f"{said} " + publish(out, machine.model, report, {"tasks": numbers, "reached": reached}, {})


if __name__ == "__main__":
    raise SystemExit(run_study("gait_plans", __doc__, study))
