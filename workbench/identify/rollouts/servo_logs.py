"""Servo logs of a robot on a fixed base, straight from the compiled station: angles at the frames that are looked at, no more."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from workbench.cache import Cache
from workbench.identify.options import PROBLEM
from workbench.identify.rollouts.windows import recorded_states
from workbench.motion.commands import Commands
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig
from workbench.simulation.compiled import NotCoveredError
from workbench.simulation.compiled.angles import servo_angles
from workbench.simulation.job import Job
from workbench.types import Array, Mask

if TYPE_CHECKING:
    from workbench.identify.problem import TakeEvidence
    from workbench.identify.rollouts.evaluator import RolloutRequest

SETTLE = 0.02
"""Rest of a robot whose log begins elsewhere [s]: it is put there."""
REST = 0.1
"""Before the first command [s]."""


def is_log(e: TakeEvidence) -> bool:
    """Whether a take is a log of its servos' own angles, of a held robot, and nothing else was seen."""
    return not e.take.recorded.zeroed and e.take.spec.base == "fixed" and e.channels == e.joints


def frames(e: TakeEvidence) -> Mask:
    """Frames of a log that are looked at."""
    return np.asarray((e.since >= 0) & (e.since <= e.until))


def most_together(evidence: Sequence[TakeEvidence], config: SimulationConfig,
                  questions: Sequence[tuple[RolloutRequest, Sequence[int]]]) -> int:
    """How many requests are played at once: `PROBLEM.together`, or fewer where rollouts are so long and finely logged that their
    angles would take more than `PROBLEM.played` MiB."""
    largest = 1.0
    for step, takes, joints in {(q.step, tuple(takes), len(q.model.joints)) for q, takes in questions}:
        every = replace(config, time_step=step * config.time_step).logged_every
        seconds = sum(min(evidence[i].until, float(evidence[i].since[-1])) for i in takes)
        largest = max(largest, 8 * joints * seconds / every)
    return max(1, min(PROBLEM.together, int((PROBLEM.played << 20) / largest)))


@lru_cache(maxsize=16)
def _log_config(config: SimulationConfig) -> SimulationConfig:
    """The configuration in which logs are rolled out."""
    return replace(config, base="fixed", settle=SETTLE)


def log_angles(evidence: Sequence[TakeEvidence], config: SimulationConfig,
               questions: Sequence[tuple[RolloutRequest, tuple[int, ...]]]) -> list[list[Array] | None]:
    """The angles (M, c) [rad] of each request at each log's `frames`, on some takes; None where the compiled station does not
    know the model's physics. config: of the search, whose steps a request counts; base and rest are a log's. Robots of one
    structure play a log together."""
    held = {step: _log_config(replace(config, time_step=step * config.time_step)) for step in {q.step for q, _ in questions}}
    played = servo_angles([_jobs([evidence[i] for i in takes], q.model, held[q.step], q.horizon) for q, takes in questions])
    return [None if isinstance(angles, NotCoveredError) else
            [each[:, [q.model.joints.index(j) for j in evidence[i].joints]] for i, each in zip(takes, angles)]
            for (q, takes), angles in zip(questions, played)]


def _jobs(takes: Sequence[TakeEvidence], model: RobotModel, config: SimulationConfig, horizon: float) -> list[Job]:
    """horizon [s]: of windows, each of which starts from the recorded state."""
    models: dict[str, RobotModel] = {}
    jobs = []
    for e in takes:
        spec = e.take.spec
        as_it_was = spec.conditions
        models.setdefault(as_it_was, spec.robot(model))
        times = e.since[frames(e)]
        sent = None if e.take.commands is None else _in_order(e.take.commands, model.joints)
        jobs.append(Job(models[as_it_was], config, sent, float(times[-1]) + 2e-3, REST, name=spec.name, times=times,
                        start=e.take.start_state(),
                        restarts=None if math.isinf(horizon) else recorded_states(e.take, horizon)))
    return jobs


_ordered: Cache[Commands] = Cache(PROBLEM.states_kept)


def _in_order(commands: Commands, joints: tuple[str, ...]) -> Commands:
    """`Commands.reordered`, the same object for the same commands: results derived from them are cached by object."""
    return _ordered.get((id(commands), joints), lambda: commands.reordered(joints), commands)
