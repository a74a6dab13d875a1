"""A gait from trajectory optimisation alone: the programme's own joint path as a table, tried as any gait is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.planned import table_shape, tasks_of
from workbench.gait.search import Found, keeps_all_but_speed, steer
from workbench.gait.shape import GaitShape
from workbench.gait.space import space_of
from workbench.gait.trajopt import Planned, plan
from workbench.types import Progress

Offsets = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Plans:
    """Solved programmes of a request by the offsets of their shapes, which steering leaves as they are. asked: how many were
    tried."""

    solved: Mapping[Offsets, Planned] = field(default_factory=dict)
    shapes: tuple[GaitShape, ...] = ()
    asked: int = 0

    def with_refined(self, before: Found, after: Found) -> Plans:
        """The plans, in which gaits refined from the best one of a search belong to its programme."""
        planned, known = self.of(before.best.shape), {before.best.shape, *(c.shape for c in before.others)}
        new = [c.shape.offsets for c in (after.best, *after.others) if c.shape not in known]
        return self if planned is None else replace(self, solved={**self.solved, **dict.fromkeys(new, planned)})

    def of(self, shape: GaitShape) -> Planned | None:
        """The programme behind a shape; None of one that was not planned."""
        return self.solved.get(shape.offsets)


def plans_of(evaluator: Evaluator, progress: Progress) -> Plans:
    """Solves the programmes of a request."""
    tasks, solved, shapes = tasks_of(evaluator.request, evaluator.machine), {}, []
    for k, task in enumerate(tasks):
        progress(f"planning: {task.name}", k / len(tasks))
        planned = plan(evaluator.machine, task)
        if planned.solved:
            shapes.append(table_shape(evaluator.machine, planned))
            solved[shapes[-1].offsets] = planned
    return Plans(solved, tuple(shapes), len(tasks))


def choose_plan(evaluator: Evaluator, plans: Plans, progress: Progress) -> Found | None:
    """The plans' tables on the nominal robot and on all of the evaluator's others, the best first; None where none was solved, or
    none has a table."""
    if not plans.shapes:
        return None
    progress(f"{len(plans.shapes)} planned tables on {1 + len(evaluator.draws)} robots", None)
    space = space_of(evaluator.machine, evaluator.request)
    walked = steer(evaluator, space, evaluator.judge(plans.shapes, 0))
    tried = evaluator.judge([c.shape for c in walked], len(evaluator.draws), list) if evaluator.draws else walked
    ranked = sorted((c for c in tried if c.nominal is not None), key=Candidate.rank)
    if not ranked:
        return None
    slow = [c for c in ranked if keeps_all_but_speed(c)]
    nearest = max(slow, key=lambda c: evaluator.request.progress(c.nominal) if c.nominal else 0.0, default=None)
    return Found(ranked[0], nearest, 0, evaluator.rollouts, tuple(ranked[1:]))


def plan_entry(c: Candidate, plans: Plans) -> dict[str, object]:
    """The certificate's entry for the programme behind a gait: its task, planned speed [m/s, for a turn in place rad/s], and the
    share of it that the nominal robot reaches; empty for a gait that was not planned."""
    planned = plans.of(c.shape)
    if planned is None or c.nominal is None:
        return {}
    asked = float(np.hypot(*planned.task.velocity))
    reached = float(np.hypot(*c.nominal.velocity)) if asked else abs(c.nominal.turn_rate)
    speed = asked or abs(planned.task.turn_rate)
    return {"planned": {"task": planned.task.name, "solver": planned.solver, "speed": speed, "share of it": reached / speed}}
