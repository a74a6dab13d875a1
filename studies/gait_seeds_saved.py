"""What planned seeds save a search: rollouts until the best gait that keeps every limit is near the best that any search found.

Each request is searched on the nominal robot alone, with the kino-centroidal programmes' seeds beside random ones and with random
ones alone, from the same seeds of the random generator.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.limits import GaitLimits
from workbench.gait.machine import GaitMachine
from workbench.gait.planned import planned_seeds
from workbench.gait.request import Request
from workbench.gait.search import Budget, search
from workbench.gait.shape import GaitShape

NEAR = 0.9
"""Share of the best speed that counts as near it."""
BUDGET = Budget(seeds=60, starts=3, generations=24, draws=0)
REQUESTS = {"forward": Request(), "backward": Request("backward"), "sideways": Request("sideways"),
            "10 deg uphill": Request(slope=math.radians(10)),
            "forward, RMS torque 0.28 N m": Request(limits=GaitLimits(rms=0.28))}


@dataclass(frozen=True)
class Saved:
    """One request's searches. best: speed of the best gait of any search [m/s]; planned, random: by seed of the random generator,
    rollouts until NEAR of it; None for a search that did not reach it."""

    best: float
    planned: tuple[int | None, ...]
    random: tuple[int | None, ...]


class _Watched(Evaluator):
    """Notes after how many rollouts which speed was reached within every limit."""

    def __init__(self, machine: GaitMachine, request: Request) -> None:
        super().__init__(machine, request, [])
        self.course: list[tuple[int, float]] = []

    def judge(self, shapes: Sequence[GaitShape], draws: int, keep: Callable[[list[Candidate]], list[Candidate]] | None = None,
              ) -> list[Candidate]:
        out = super().judge(shapes, draws, keep)
        reached = [self.request.progress(c.nominal) for c in out if c.good and c.nominal]
        self.course.append((self.rollouts, max(reached, default=0.0)))
        return out


def saved(machine: GaitMachine, request: Request, seeds: Sequence[int], budget: Budget = BUDGET) -> Saved:
    """One request's searches by both kinds of seeds."""
    planned, random = ([_course(machine, request, seed, given, budget) for seed in seeds]
                       for given in (planned_seeds(machine, request), ()))
    best = max(speed for course in (*planned, *random) for _, speed in course)
    return Saved(best, *(tuple(_until(course, NEAR * best) for course in courses) for courses in (planned, random)))


def _course(machine: GaitMachine, request: Request, seed: int, given: Sequence[GaitShape], budget: Budget
            ) -> list[tuple[int, float]]:
    evaluator = _Watched(machine, request)
    search(evaluator, budget, seed, lambda what, share: None, given)
    return evaluator.course


def _until(course: Sequence[tuple[int, float]], speed: float) -> int | None:
    return next((rollouts for rollouts, reached in course if reached >= speed > 0), None)
