"""Drake checks the compiled station.

Every diagnosis rolls out its nominal and its final model in both engines. If they disagree, it starts again with Drake alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench.identify.options import PROBLEM
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.robot import RobotModel

COMPILED = "the compiled station"
"""Whose rollouts a diagnosis stands on where Drake agrees."""


class EnginesPartError(ArithmeticError):
    """The compiled station and Drake disagree on a model; the text gives the difference."""


def judge_by_drake(evaluator: RolloutEvaluator, model: RobotModel, name: str) -> float:
    """Difference between the engine of a search and Drake on a model, RMS over sigma of the worst channel, of one take nearly
    whole and of the others' beginnings. 0 where rollouts are Drake's already. EnginesPartError beyond
    `ProblemOptions.engines_apart`; name: of the model, for its text."""
    if evaluator.config.engine == "drake":
        return 0.0
    drake = RolloutEvaluator(evaluator.evidence, replace(evaluator.config, engine="drake"), evaluator.n_jobs, evaluator.memory)
    takes = range(len(evaluator.evidence))
    whole = next((i for i in takes if evaluator.any_floating((i,))), 0)
    questions = [RolloutRequest(model, (whole,), until=PROBLEM.engines_compared_whole),
                 RolloutRequest(model, tuple(i for i in takes if i != whole), until=PROBLEM.engines_compared)]
    ours, theirs = ({i: r for answer in e.residuals(questions) for i, r in answer.items()} for e in (evaluator, drake))
    worst = 0.0
    for i, residual in ours.items():
        apart = np.square(residual - theirs[i])
        seen = np.isfinite(apart)
        each = np.sqrt(np.where(seen, apart, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1))
        worst = max(worst, float(each.max(initial=0.0)))
        if np.any(np.isfinite(residual) != np.isfinite(theirs[i])) or worst > PROBLEM.engines_apart:
            raise EnginesPartError(f"the compiled station and Drake part by {worst:.2g} sigma on the {name} model")
    return float(f"{worst:.2g}")
