"""The search for a gait: random seeds, then CMA-ES over the ensemble, deterministic by seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cma
import numpy as np

from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.limits import Margin, binding
from workbench.gait.shape import GaitShape
from workbench.gait.space import Space, seeds, space_of

Progress = Callable[[str, float | None], None]


@dataclass(frozen=True)
class Budget:
    """How much is tried, in numbers of gaits and not in seconds, so that the same seed ends in the same table.

    seeds: random gaits at first. starts: the best of them, of different families or knees, from which CMA-ES goes on. population,
    generations: of each start, on the nominal robot; then `robust` generations of the better start over `draws` robots of the
    ensemble. width: first standard deviation in the unit cube. enough: a search for a given speed ends after so many
    generations in a row that kept every limit.
    """

    seeds: int = 160
    starts: int = 2
    population: int = 12
    generations: int = 10
    robust: int = 20
    draws: int = 16
    width: float = 0.15
    enough: int = 3


@dataclass(frozen=True)
class Found:
    """What a search ended with. best: the best gait; nearest: the best that keeps all limits but the speed asked for, if `best`
    does not keep that; generations and rollouts: how many it took."""

    best: Candidate
    nearest: Candidate | None
    generations: int
    rollouts: int

    @property
    def binds(self) -> Margin | None:
        """The limit that leaves `best` least."""
        return binding(self.best.margins)


def search(evaluator: Evaluator, budget: Budget, seed: int, progress: Progress, given: Sequence[GaitShape] = ()) -> Found:
    """Seeks a gait for the evaluator's request. given: shapes to start from, beside the random ones."""
    space = space_of(evaluator.machine, evaluator.request)
    run = _Run(evaluator, budget, space, progress)
    shapes = [*given, *seeds(evaluator.machine, evaluator.request, space, budget.seeds, seed)]
    started = run.seeded(shapes)
    runs = [_Refiner(run, c, seed + 1 + k) for k, c in enumerate(started)]
    for _ in range(budget.generations):
        for refiner in runs:
            refiner.generation(0)
            if run.enough():
                break
    if budget.robust and evaluator.draws:
        run.forget_streak()
        top = run.best
        assert top is not None
        refiner = next((r for r in runs if r.is_of(top.shape)), runs[0])
        for _ in range(budget.robust):
            refiner.generation(budget.draws)
            if run.enough():
                break
    assert run.best is not None
    return Found(run.best, run.nearest, run.generation, evaluator.rollouts)


class _Run:
    """What is known so far."""

    def __init__(self, evaluator: Evaluator, budget: Budget, space: Space, progress: Progress) -> None:
        self.evaluator, self.budget, self.space, self.progress = evaluator, budget, space, progress
        self.best: Candidate | None = None
        self.nearest: Candidate | None = None
        self.generation = 0
        self._streak = 0
        self._robust = False
        robust = budget.robust if evaluator.draws else 0
        self._all = budget.starts * budget.generations + robust

    def seeded(self, shapes: Sequence[GaitShape]) -> list[Candidate]:
        """The best seeds, each of another family or another way of the knees."""
        judged: list[Candidate] = []
        for k in range(0, len(shapes), 40):
            self.progress(f"seeds {k} of {len(shapes)}{self._told()}", 0.0)
            judged += self.evaluator.judged(shapes[k:k + 40], 0)
            self._note(judged[k:])
        out: list[Candidate] = []
        for c in sorted(judged, key=Candidate.rank):
            if all((c.shape.family, c.shape.knees) != (o.shape.family, o.shape.knees) for o in out):
                out.append(c)
        return out[:self.budget.starts]

    def note_generation(self, candidates: list[Candidate], robust: bool) -> None:
        """After a generation: keeps the best, tells it."""
        if robust and not self._robust:
            self._robust, self.best, self.nearest = True, None, None  # what was found on the nominal robot alone counts no more
        self._note(candidates)
        self.generation += 1
        assert self.best is not None
        self._streak = self._streak + 1 if self.best.good else 0
        self.progress(f"generation {self.generation} of {self._all}{self._told()}", self.generation / self._all)

    def forget_streak(self) -> None:
        """Before the ensemble comes in."""
        self._streak = 0

    def enough(self) -> bool:
        """Whether a search for a given speed may stop."""
        request = self.evaluator.request
        return request.speed is not None and request.aim == "speed" and self._streak >= self.budget.enough

    def _note(self, candidates: list[Candidate]) -> None:
        told = [c for c in candidates if c.draws or not self._robust]
        for c in told:
            if self.best is None or c.rank() < self.best.rank():
                self.best = c
            if _slow_only(c) and (self.nearest is None or self._speed(c) > self._speed(self.nearest)):
                self.nearest = c

    def _speed(self, c: Candidate) -> float:
        assert c.nominal is not None
        return self.evaluator.request.progress(c.nominal)

    def _told(self) -> str:
        """The best so far in words, with the limit that binds."""
        if self.best is None or self.best.nominal is None:
            return ""
        limit = binding(self.best.margins)
        speed, unit = self._speed(self.best), self.evaluator.request.unit
        said = f"{math.degrees(speed):.0f} deg/s" if unit == "rad/s" else f"{speed:.3f} m/s"
        broken = "" if self.best.good else "; not yet within limits"
        return f": {said}{broken}; binds: {limit}" if limit else f": {said}"


def _slow_only(c: Candidate) -> bool:
    """Whether a gait keeps every limit, speed apart."""
    return c.nominal is not None and all(m.use <= 1 or m.advice or m.name.startswith("speed") for m in c.margins)


class _Refiner:
    """One CMA-ES, whose constraints are kept by rank: a gait that breaks a limit comes after all that break none."""

    def __init__(self, run: _Run, start: Candidate, seed: int) -> None:
        self._run, self._family, self._knees = run, start.shape.family, start.shape.knees
        options = {"popsize": run.budget.population, "seed": seed, "bounds": [0.0, 1.0], "verbose": -9, "verb_log": 0,
                   "integer_variables": [], "maxiter": 10**6, "tolstagnation": 10**6, "tolfun": 0, "tolx": 0, "tolfunhist": 0}
        x0 = np.clip(run.space.point(start.shape), 0.02, 0.98)
        self._strategy = cma.CMAEvolutionStrategy(x0, run.budget.width, options)

    def is_of(self, shape: GaitShape) -> bool:
        """Whether the shape is of this refiner's family and knees."""
        return (shape.family, shape.knees) == (self._family, self._knees)

    def generation(self, draws: int) -> None:
        """One generation, on the nominal robot, and its better half on `draws` more."""
        run = self._run
        points = self._strategy.ask()
        shapes = [run.space.shape(np.asarray(x), self._family, self._knees) for x in points]
        judged = run.evaluator.judged(shapes, draws, _better_half if draws else None)
        order = sorted(range(len(judged)), key=lambda k: (bool(draws) and not judged[k].draws, *judged[k].rank()))
        cost = np.empty(len(judged))
        cost[order] = np.arange(len(judged))
        self._strategy.tell(points, cost.tolist())
        run.note_generation(judged, bool(draws))


def _better_half(candidates: list[Candidate]) -> list[Candidate]:
    """The better half by what they do on the nominal robot."""
    return sorted(candidates, key=Candidate.rank)[:(len(candidates) + 1) // 2]
