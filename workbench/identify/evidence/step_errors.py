"""The time-step error of a rollout, subtracted from its residuals.

A discrete step of a servo robot is of the first order: a command acts about half a step late, and later in a joint that follows
steps of its goal. At the steps of a search that is more than a log's noise, and a fit would take it for torque, friction or
delay. Richardson's extrapolation estimates it, from rollouts at half and at a quarter of the search's step
(L. Richardson, Phil. Trans. A 226, 1927), of the best model so far; models close to it are taken to have the same error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from workbench.identify.options import PROBLEM
from workbench.identify.rollouts.evaluator import RolloutRequest
from workbench.robot import RobotModel
from workbench.types import Array

Residuals = Mapping[int, Array]
Roll = Callable[[Sequence[RolloutRequest]], list[dict[int, Array]]]


def extrapolate(longer: Array, shorter: Array) -> Array:
    """Residuals in the limit of a step of zero, from those at one step and at half of it, of the same shape."""
    return np.asarray(2.0 * shorter - longer)


@dataclass
class StepErrors:
    """roll: rollouts of some takes as they are, whose residuals [sigma] these are. Each model is rolled out once at each step."""

    takes: tuple[int, ...]
    roll: Roll = field(repr=False)
    _known: dict[tuple[str, float, float], dict[int, Array]] = field(default_factory=dict, repr=False)
    _ideal: dict[tuple[str, float], dict[int, Array]] = field(default_factory=dict, repr=False)

    def at(self, model: RobotModel, step: float, horizon: float = np.inf) -> Residuals:
        """The error of each take that a step, in steps of the search, adds to a model's residuals (N, c) [sigma]; 0 where
        unknown. horizon [s]: of windows."""
        key = (model.sha256, horizon)
        if (*key, step) not in self._known:
            steps = (step,) if key in self._ideal else (step, 2 * PROBLEM.fine, PROBLEM.fine)
            here, *finer = self.roll([RolloutRequest(model, self.takes, s, horizon=horizon) for s in steps])
            if finer:
                longer, shorter = finer
                self._ideal[key] = {i: extrapolate(longer[i], shorter[i]) for i in self.takes}
            self._known[*key, step] = {i: np.nan_to_num(here[i] - self._ideal[key][i]) for i in self.takes}
        return self._known[*key, step]
