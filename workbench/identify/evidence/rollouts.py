"""Rollouts of several regions at once; of servo logs on a fixed base straight from the compiled station where it covers them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from workbench.identify.evidence.hypothesis import Hypothesis, Uncertain, start
from workbench.identify.evidence.nuisance import as_mapping, recalibrated
from workbench.identify.evidence.region import Region
from workbench.identify.evidence.step_errors import StepErrors
from workbench.identify.evidence.windows import recorded_states
from workbench.identify.rollouts import RolloutEvaluator, RolloutRequest
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig
from workbench.simulation.compiled import NotCoveredError
from workbench.simulation.compiled.angles import servo_angles
from workbench.simulation.job import Job

Array = NDArray[np.float64]
Wants = tuple[int, Hypothesis]
"""A region, by its index, and what it wants rolled out."""
SETTLE = 0.02
"""Rest of a robot whose log begins elsewhere [s]: it is put there."""


def residuals_of(evaluator: RolloutEvaluator, questions: Sequence[RolloutRequest]) -> list[dict[int, Array]]:
    """As `RolloutEvaluator.residuals`, as the rollouts are, whatever their step is wrong by; of logs without shifting their
    start, which is known."""
    by_drake = evaluator.config.engine == "drake"
    if by_drake or not questions or not all(_is_log(evaluator, i) for q in questions for i in q.takes):
        return [_uncorrected(evaluator, q, answer) for q, answer in zip(questions, evaluator.residuals(questions))]
    with ThreadPoolExecutor(evaluator.n_jobs) as pool:  # kernels hold no lock
        return list(pool.map(lambda q: _answer(evaluator, q), questions))


def _uncorrected(evaluator: RolloutEvaluator, q: RolloutRequest, residuals: dict[int, Array]) -> dict[int, Array]:
    """Without what `RolloutEvaluator` takes off for the search's step."""
    if q.step < 1:
        return residuals
    return {i: r + e.offset / (e.sigma * e.rough) for i, r in residuals.items() for e in (evaluator.evidence[i],)}


def _answer(evaluator: RolloutEvaluator, q: RolloutRequest) -> dict[int, Array]:
    held = replace(evaluator.config, base="fixed", settle=SETTLE, time_step=q.step * evaluator.config.time_step)
    models: dict[str, RobotModel] = {}
    jobs = []
    for i in q.takes:
        spec = evaluator.evidence[i].take.spec
        key = repr(sorted(spec.servos.items()))
        models.setdefault(key, q.model.with_servos(spec.servos))
        jobs.append(_job(evaluator, i, models[key], held, q.horizon))
    try:
        angles = servo_angles(jobs)
    except NotCoveredError:
        return _uncorrected(evaluator, q, evaluator.residuals([q])[0])
    evaluator.rollouts += len(jobs)
    out = {}
    for i, q_servo in zip(q.takes, angles):
        e = evaluator.evidence[i]
        columns = [q.model.joints.index(j) for j in e.joints]
        simulated = np.full(e.recorded.shape, np.nan)
        simulated[(e.since >= 0) & (e.since <= e.until)] = q_servo[:, columns]
        out[i] = (e.recorded - simulated) / (e.sigma * e.rough)
    return out


def _job(evaluator: RolloutEvaluator, i: int, model: RobotModel, held: SimulationConfig, horizon: float) -> Job:
    take = evaluator.evidence[i].take
    times = evaluator.evidence[i].since
    times = times[(times >= 0) & (times <= evaluator.evidence[i].until)]
    return Job(model, held, take.commands, float(times[-1]) + 2e-3, 0.1, name=take.spec.name,
               times=times, start=take.start_state(),
               restarts=None if np.isinf(horizon) else recorded_states(take, horizon))


def _is_log(evaluator: RolloutEvaluator, i: int) -> bool:
    e = evaluator.evidence[i]
    return not e.take.recorded.zeroed and e.take.spec.base == "fixed" and e.channels == e.joints


@dataclass(frozen=True)
class Rollouts:
    """Rolls hypotheses of all regions out. standing: what is taken for the others while one region's is looked at.
    errors: of the time step, which are subtracted; they are measured on `reference`, a model near those that are compared.
    step: in steps of the search. horizon [s]: of windows, each of which starts from the recorded state. shared: effects of the whole
    robot, which act in all regions."""

    evaluator: RolloutEvaluator
    nominal: RobotModel
    regions: tuple[Region, ...]
    standing: tuple[Hypothesis, ...]
    errors: StepErrors
    reference: RobotModel
    step: float = 1.0
    horizon: float = np.inf
    shared: Hypothesis = field(default_factory=lambda: start(()))

    @classmethod
    def of(cls, evaluator: RolloutEvaluator, nominal: RobotModel, regions: Sequence[Region]) -> Rollouts:
        """With the nominal law standing everywhere."""
        return cls(evaluator, nominal, tuple(regions), tuple(start(r.numbers) for r in regions),
                   step_errors(evaluator, regions), nominal)

    def model(self, hypotheses: Sequence[Hypothesis]) -> RobotModel:
        """One robot with a hypothesis for each region."""
        z: dict[Uncertain, float] = {}
        for h in hypotheses:
            z |= as_mapping(h.numbers, h.z)
        model = recalibrated(self.nominal, z)
        return model.with_effects((*model.effects, *(spec for h in (*hypotheses, self.shared) for spec in h.specs())))

    def around_here(self, step: float, horizon: float | None = None) -> Rollouts:
        """The same at another step, whose error is measured on the current best model from now on, and over another horizon [s]:
        fits that are compared have to be rolled out again."""
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
        """In the limit of a step of zero."""
        wrong = self.errors.at(self.reference, self.step, self.horizon) if questions else {}
        return [{i: r - wrong[i] for i, r in answer.items()} for answer in residuals_of(self.evaluator, questions)]


def step_errors(evaluator: RolloutEvaluator, regions: Sequence[Region]) -> StepErrors:
    """Of the takes that regions look at."""
    takes = tuple(sorted({p.take for region in regions for p in region.parts}))
    return StepErrors(takes, partial(residuals_of, evaluator))
