"""Rollouts of several regions at once, less the error of their time step.

A discrete step of a servo robot is of the first order: a command acts about half a step late, and later in a joint that follows
steps of its goal. At the steps of a search that is more than a log's noise, and a fit would take it for torque, friction or
delay. Richardson's extrapolation estimates it, from rollouts at half and at a quarter of the search's step
(L. Richardson, Phil. Trans. A 226, 1927), of the best model so far; models close to it are taken to have the same error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from workbench.effects.apply import add_possible
from workbench.identify.evidence.hypothesis import Hypothesis, Uncertain, start
from workbench.identify.evidence.nuisance import as_mapping, recalibrate
from workbench.identify.evidence.region import Region
from workbench.identify.options import PROBLEM
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.robot import RobotModel
from workbench.types import Array

Wants = tuple[int, Hypothesis]
"""A region, by its index, and its request for rollouts."""
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


@dataclass(frozen=True)
class Rollouts:
    """Rolls out hypotheses of all regions. standing: hypotheses used for the others while one region is examined.
    errors: of the time step, which are subtracted; they are measured on `reference`, a model close to the compared ones.
    step: in steps of the search. horizon [s]: of windows, each of which starts from the recorded state. shared: effects of the
    whole robot, which act in all regions. most_work: limit of the work, as `RolloutMemory.work` counts it."""

    evaluator: RolloutEvaluator
    nominal: RobotModel
    regions: tuple[Region, ...]
    standing: tuple[Hypothesis, ...]
    errors: StepErrors
    reference: RobotModel
    step: float = 1.0
    horizon: float = math.inf
    shared: Hypothesis = field(default_factory=lambda: start(()))
    most_work: float = math.inf

    @classmethod
    def of(cls, evaluator: RolloutEvaluator, nominal: RobotModel, regions: Sequence[Region], most_work: float = math.inf
           ) -> Rollouts:
        """Rollouts in which every region has the nominal law."""
        return cls(evaluator, nominal, tuple(regions), tuple(start(r.numbers) for r in regions),
                   step_errors(evaluator, regions), nominal, most_work=most_work)

    @property
    def exhausted(self) -> bool:
        """Whether all the work was done that may be."""
        return math.isfinite(self.most_work) and self.evaluator.memory.work > self.most_work

    def model(self, hypotheses: Sequence[Hypothesis]) -> RobotModel:
        """One robot with a hypothesis for each region."""
        z: dict[Uncertain, float] = {}
        for h in hypotheses:
            z |= as_mapping(h.numbers, h.z)
        model = recalibrate(self.nominal, z)
        for law in (h.law for h in hypotheses if h.law is not None):
            model = law.added_to(model)
        return add_possible(model, [spec for h in (*hypotheses, self.shared) for spec in h.specs()])

    def around_here(self, step: float, horizon: float | None = None) -> Rollouts:
        """The same rollouts at another step, whose error is measured on the current best model from now on, and over another
        horizon [s]: fits that are compared have to be rolled out again."""
        return replace(self, step=step, horizon=self.horizon if horizon is None else horizon, reference=self.model(self.standing))

    def everywhere(self, states: Sequence[tuple[Hypothesis, Sequence[Hypothesis]]]) -> list[tuple[Array, ...]]:
        """Residuals (n,) of every region, of shared effects with a hypothesis for each region."""
        takes = tuple(sorted({p.take for region in self.regions for p in region.parts}))
        questions = [RolloutRequest(replace(self, shared=shared).model(each), takes, self.step, horizon=self.horizon)
                     for shared, each in states]
        return [tuple(region.vector(r) for region in self.regions) for r in self._residuals(questions)]

    def answers(self, wants: Sequence[Wants]) -> list[Array]:
        """Residuals (n,) of each want's region. Wants of different regions share rollouts."""
        queues: dict[int, list[int]] = {}
        for k, (region, _) in enumerate(wants):
            queues.setdefault(region, []).append(k)
        questions, shared = [], []
        for row in range(max(map(len, queues.values()), default=0)):
            here = {region: queue[row] for region, queue in queues.items() if row < len(queue)}
            hypotheses = [wants[here[i]][1] if i in here else h for i, h in enumerate(self.standing)]
            takes = tuple(sorted({p.take for i in here for p in self.regions[i].parts}))
            questions.append(RolloutRequest(self.model(hypotheses), takes, self.step, horizon=self.horizon))
            shared.append(here)
        out: list[Array] = [np.empty(0)] * len(wants)
        for here, residuals in zip(shared, self._residuals(questions)):
            for region, k in here.items():
                out[k] = self.regions[region].vector(residuals)
        return out

    def _residuals(self, questions: Sequence[RolloutRequest]) -> list[dict[int, Array]]:
        """Residuals in the limit of a step of zero."""
        wrong = self.errors.at(self.reference, self.step, self.horizon) if questions else {}
        return [{i: r - wrong[i] for i, r in answer.items()} for answer in self.evaluator.uncorrected(questions)]


def step_errors(evaluator: RolloutEvaluator, regions: Sequence[Region]) -> StepErrors:
    """Step errors of the takes that regions use."""
    takes = tuple(sorted({p.take for region in regions for p in region.parts}))
    return StepErrors(takes, evaluator.uncorrected)
