"""Processor time of one diagnosis, by stage."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.arm import arm, frictions, goals, measured, played, session
from benchmarks.figure import Figure
from workbench.compare.session import Session
from workbench.compare.session_takes import read_takes
from workbench.experiment.next_experiment import with_next_experiment
from workbench.identify.diagnosis import diagnose_session
from workbench.identify.options import PROBLEM
from workbench.simulation import SimulationConfig
from workbench.simulation.batch import Job, simulate_batch

NAME = "diagnose_time"
MEANING = "processor seconds of one diagnosis on one process: an arm of three joints, one log, one joint with more dry friction"
READING, SEARCH = "reading, registering, floors of the nominal robot", "search"
EXPERIMENT = "next experiment"
STAGES = (("reading", READING), ("simulating", READING), ("registering", READING), ("judging", READING),
          ("the nominal law", SEARCH), ("effects", SEARCH), ("takes kept back", SEARCH), ("names that are tied", "ties"),
          ("an unnamed torque", "unnamed torque"), ("numbers", "finer step and floors"), ("rolling out the fitted", "report"))
"""How each progress message of `diagnose_session` begins, and the stage it belongs to."""
REPEATS = 3


class Stages:
    """A `progress` callback that sums up the seconds of each stage. By default it counts processor time, which other work on the
    machine disturbs least."""

    def __init__(self, clock: Callable[[], float] = time.process_time) -> None:
        self.seconds: dict[str, float] = {}
        self._clock, self._since = clock, clock()
        self._stage = READING

    def __call__(self, what: str, done: float | None = None) -> None:
        """Starts the stage to which this message belongs, or continues it."""
        self._close()
        self._stage = next((stage for begins, stage in STAGES if what.startswith(begins)), EXPERIMENT)

    def ended(self) -> dict[str, float]:
        """Ends the current stage. Returns the seconds by stage, in the order in which the stages began."""
        self._close()
        return self.seconds

    def _close(self) -> None:
        now = self._clock()
        self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._since
        self._since = now


def diagnose_time(duration: float | None, seed: int) -> Figure:
    """duration: of the log [s]; None skips the figure."""
    if duration is None:
        return Figure(NAME, MEANING, skipped="quick: a diagnosis takes longer than the quick form may")
    with TemporaryDirectory() as place:
        model, told = arm(Path(place)), goals(duration)
        log = measured(told, played(model, told, frictions()[:1]), seed)
        mine = session(Path(place), log)
        stages, began = Stages(), time.perf_counter()
        diagnosed, _ = with_next_experiment(diagnose_session(mine, stages, n_jobs=1), 1, stages)
        seconds, wall = stages.ended(), time.perf_counter() - began
        one = _one_rollout(mine, duration)
    total, rollouts = sum(seconds.values()), int(diagnosed.provenance["rollouts"])
    details = {
        "log_seconds": duration, "n_jobs": 1, "wall_seconds": wall, "seconds_by_stage": seconds,
        "share_by_stage": {stage: s / total for stage, s in seconds.items()}, "rollouts": rollouts,
        "found": [f"{f.effect}({', '.join(f.where)})" for f in diagnosed.findings],
        "recalibrated": [f"{r.number}({', '.join(r.where)})" for r in diagnosed.recalibrated], "one_rollout": one,
        "share_of_so_many_such_rollouts": rollouts * (one["building_seconds"] + one["seconds"]) / total,
        "limits": "rollouts: of the search, most at the step given, some twice as coarse, the last at a quarter of it; the "
                  "nominal robot's three and those of a next experiment are not counted. Candidates differ in the model, so that "
                  "nearly every rollout builds a station and settles it"}
    return Figure(NAME, MEANING, total, details=details)


def _one_rollout(mine: Session, duration: float) -> dict[str, float]:
    """Processor seconds of one rollout of the nominal robot at the search's step, of building and settling its station, and of
    one step. The step is also timed without joint friction, which is one constraint per joint in Drake's contact solver."""
    (take,), _ = read_takes(mine)
    steps = round((duration + PROBLEM.rest) / PROBLEM.time_step)
    servos = {j: replace(mine.model.servo(j), coulomb_friction=0.0) for j in mine.model.joints}
    spent = {}
    for name, model in (("as it is", mine.model), ("frictionless", replace(mine.model, servos=servos))):
        # no earlier rollout had this settling time, so the first of these builds its station and the others reuse it
        config = SimulationConfig(settle=0.6 + PROBLEM.time_step, base="fixed", contact_period=0, time_step=PROBLEM.time_step)
        job = Job(model, config, take.commands, duration, PROBLEM.rest, start=take.start_state())
        first, *more = (_spent(job) for _ in range(1 + REPEATS))
        spent[name] = first, float(np.median(more))
    first, again = spent["as it is"]
    return {"step_seconds": PROBLEM.time_step, "steps": steps, "building_seconds": first - again, "seconds": again,
            "microseconds_per_step": again / steps * 1e6,
            "microseconds_per_step_without_joint_friction": spent["frictionless"][1] / steps * 1e6}


def _spent(job: Job) -> float:
    began = time.process_time()
    simulate_batch([job], 1)
    return time.process_time() - began
