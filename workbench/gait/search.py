"""The search for a gait: random seeds, then CMA-ES over the ensemble from the first generation, deterministic by seed."""

from __future__ import annotations

import math
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cma
import numpy as np

from workbench.files import InputError
from workbench.files.option_checks import check_positive, check_whole
from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.limits import Margin, binding
from workbench.gait.request import Request
from workbench.gait.requirements import excess_turning
from workbench.gait.shape import GaitShape
from workbench.gait.space import Space, seeds, space_of
from workbench.types import Array, Progress

STEERED = 2
"""How often a gait is steered before the next generation."""
APART = 0.4
"""Distance in the unit cube from which two gaits differ, less than half of what two of a first generation are apart: finalists
should not all fail for the same reason."""
TRIED = 0.6
"""Share of a generation, the better on the nominal robot, that is tried on the ensemble's robots."""
ALIKE = 4
"""How many seeds of one family and one way of the knees are tried on the ensemble's robots."""
IN_TURN = 3
"""Generations of each start before only the best of them continues."""


@dataclass(frozen=True)
class Budget:
    """Size of the search, in numbers of gaits and not in seconds, so that the same seed ends in the same table. InputError for a
    number out of range.

    seeds: random gaits at first, on the nominal robot; 0 where the search is given a gait to start from. screened: the best
    of them, which are tried on `draws` robots of the ensemble. starts: the best of those, of different families or knees,
    from which CMA-ES continues. population: of each generation, all on the nominal robot, the better on the ensemble too.
    generations: in total. width: first standard deviation in the unit cube. enough: a search for a given speed ends after so
    many generations in a row that kept every limit. hopeless: it ends halfway if the best gait has less than this share of
    the speed. finalists: gaits that may go to the certificate.
    """

    seeds: int = 120
    screened: int = 14
    starts: int = 2
    population: int = 12
    generations: int = 24
    draws: int = 8
    width: float = 0.12
    enough: int = 3
    hopeless: float = 0.6
    finalists: int = 8

    def __post_init__(self) -> None:
        check_whole(self, seeds=0, screened=1, starts=1, population=2, generations=0, draws=0, enough=1, finalists=1)
        check_positive(self, "width")


@dataclass(frozen=True)
class Found:
    """Result of a search. best: the best gait; nearest: the best that keeps all limits but the required speed, if `best`
    does not keep that; generations and rollouts: how many it took; others: the next best that differ, the best first."""

    best: Candidate
    nearest: Candidate | None
    generations: int
    rollouts: int
    others: tuple[Candidate, ...] = ()

    @property
    def binds(self) -> Margin | None:
        """The limit that leaves `best` least."""
        return binding(self.best.margins)


def search(evaluator: Evaluator, budget: Budget, seed: int, progress: Progress, given: Sequence[GaitShape] = ()) -> Found:
    """Searches for a gait for the evaluator's request. given: initial shapes, in addition to the random ones. InputError where
    there are none of either kind."""
    space = space_of(evaluator.machine, evaluator.request)
    run = _Run(evaluator, budget, space, progress)
    shapes = [*given, *(seeds(evaluator.machine, evaluator.request, space, budget.seeds, seed) if budget.seeds else ())]
    if not shapes:
        raise InputError(None, "seeds: expected 1 or more, or a gait to start from, got 0")
    runs = [_Refiner(run, c, seed + 1 + k) for k, c in enumerate(run.seed_points(shapes))]
    for k in range(budget.generations):
        together = k < IN_TURN * len(runs)
        refiner = runs[k % len(runs)] if together else min(runs, key=lambda r: r.best.rank())
        refiner.generation()
        if run.enough() or (2 * k >= budget.generations and run.hopeless()):
            break
    assert run.best is not None
    return Found(run.best, run.nearest, run.generation, evaluator.rollouts, run.others())


class _Run:
    """Results so far."""

    def __init__(self, evaluator: Evaluator, budget: Budget, space: Space, progress: Progress) -> None:
        self.evaluator, self.budget, self.space, self.progress = evaluator, budget, space, progress
        self.best: Candidate | None = None
        self.nearest: Candidate | None = None
        self.generation = 0
        self.draws = min(budget.draws, len(evaluator.draws))
        self._streak = 0
        self._seen: list[Candidate] = []

    def seed_points(self, shapes: Sequence[GaitShape]) -> list[Candidate]:
        """Starting points: the best on the ensemble of the best seeds, each of another family or another way of the
        knees."""
        judged: list[Candidate] = []
        for k in range(0, len(shapes), 40):
            self.progress(f"seeds {k} of {len(shapes)}", 0.0)
            judged += steer(self.evaluator, self.space, self.evaluator.judge(shapes[k:k + 40], 0))
        screened: list[Candidate] = []
        kinds = Counter[tuple[str, tuple[int, int]]]()
        for c in sorted(judged, key=Candidate.rank):
            kinds[_kind(c)] += 1
            if kinds[_kind(c)] <= ALIKE and len(screened) < self.budget.screened:
                screened.append(c)
        self.progress(f"{len(screened)} gaits on {self.draws} robots of the ensemble", None)
        tried = self.try_on_draws(screened)
        self._note(tried)
        out: list[Candidate] = []
        for c in sorted(tried, key=Candidate.rank):
            if all(_kind(c) != _kind(o) for o in out):
                out.append(c)
        return out[:self.budget.starts]

    def try_on_draws(self, candidates: Sequence[Candidate]) -> list[Candidate]:
        """Tries candidates on the robots of the ensemble; those that do not even walk on the nominal one are returned as they
        are."""
        return self.evaluator.judge([c.shape for c in candidates], self.draws, list) if self.draws else list(candidates)

    def note_generation(self, candidates: Sequence[Candidate]) -> None:
        """After a generation: keeps the best, reports it."""
        self._note(candidates)
        self.generation += 1
        assert self.best is not None
        self._streak = self._streak + 1 if self.best.good else 0
        done = self.generation / self.budget.generations
        self.progress(f"generation {self.generation} of {self.budget.generations}{self._describe()}", done)

    def others(self) -> tuple[Candidate, ...]:
        """The next best that differ from those before them."""
        out = [] if self.best is None else [self.best]
        for c in sorted(self._seen, key=Candidate.rank):
            if len(out) >= self.budget.finalists:
                break
            alike = [o for o in out if _kind(c) == _kind(o)]
            point = self.space.point(c.shape)
            if c.nominal is not None and all(np.linalg.norm(point - self.space.point(o.shape)) > APART for o in alike):
                out.append(c)
        return tuple(out[1:])

    def hopeless(self) -> bool:
        """Whether the required speed is far from the best so far."""
        asked, found = self.evaluator.request.speed, self.nearest or self.best
        if asked is None or found is None or found.nominal is None:
            return False
        return self._speed(found) < self.budget.hopeless * asked

    def enough(self) -> bool:
        """Whether a search for a given speed may stop."""
        request = self.evaluator.request
        return request.speed is not None and request.aim == "speed" and self._streak >= self.budget.enough

    def _note(self, candidates: Sequence[Candidate]) -> None:
        judged_on_draws = [c for c in candidates if len(c.draws) >= self.draws]
        self._seen += judged_on_draws
        for c in judged_on_draws or candidates:
            if self.best is None or (self._known(c), *c.rank()) < (self._known(self.best), *self.best.rank()):
                self.best = c
            if keeps_all_but_speed(c) and (self.nearest is None or self._speed(c) > self._speed(self.nearest)):
                self.nearest = c

    def _known(self, c: Candidate) -> bool:
        """Sorts candidates tried on the ensemble first."""
        return len(c.draws) < self.draws

    def _speed(self, c: Candidate) -> float:
        assert c.nominal is not None
        return self.evaluator.request.progress(c.nominal)

    def _describe(self) -> str:
        """The best so far in words, with the limit that binds."""
        if self.best is None or self.best.nominal is None:
            return ""
        limit = binding(self.best.margins)
        speed, unit = self._speed(self.best), self.evaluator.request.unit
        pace = f"{math.degrees(speed):.0f} deg/s" if unit == "rad/s" else f"{speed:.3f} m/s"
        broken = "" if self.best.good else "; not yet within limits"
        return f": {pace}{broken}; binds: {limit}" if limit else f": {pace}"


def _kind(c: Candidate) -> tuple[str, tuple[int, int]]:
    return c.shape.family, c.shape.knees


def keeps_all_but_speed(c: Candidate) -> bool:
    """Whether a gait keeps every limit, speed apart."""
    return c.nominal is not None and all(m.use <= 1 or m.advice or m.kind == "speed" for m in c.margins)


class _Refiner:
    """One CMA-ES over the ensemble: candidates tried on it come first, by cost plus penalty."""

    def __init__(self, run: _Run, start: Candidate, seed: int) -> None:
        self._run, self._start = run, start.shape
        self._family, self._knees = start.shape.family, start.shape.knees
        self.best = start
        options = {"popsize": run.budget.population, "seed": seed, "bounds": [0.0, 1.0], "verbose": -9, "verb_log": 0,
                   "integer_variables": [], "maxiter": 10**6, "tolstagnation": 10**6, "tolfun": 0, "tolx": 0, "tolfunhist": 0}
        x0 = np.clip(run.space.point(start.shape), 0.02, 0.98)
        self._strategy = cma.CMAEvolutionStrategy(x0, run.budget.width, options)

    def _shape(self, x: Array) -> GaitShape:
        """The shape at a point of the unit cube; angles added to a planned start's poses are kept."""
        shape, start = self._run.space.shape(x, self._family, self._knees), self._start
        return replace(shape, poses=start.poses, offsets=start.offsets) if start.offsets else shape

    def generation(self) -> None:
        """Tries one generation on the nominal robot, and its better part on the ensemble."""
        run = self._run
        points = [np.asarray(x) for x in self._strategy.ask()]
        judged = run.evaluator.judge([self._shape(x) for x in points], 0)
        judged = steer(run.evaluator, run.space, judged)
        better = sorted(range(len(judged)), key=lambda k: judged[k].merit)[:math.ceil(TRIED * len(judged))]
        better = [k for k in better if judged[k].nominal is not None]
        for k, c in zip(better, run.try_on_draws([judged[k] for k in better])):
            judged[k] = c
        order = sorted(range(len(judged)), key=lambda k: (k not in better, judged[k].merit))
        cost = np.empty(len(judged))
        cost[order] = np.arange(len(judged))
        if "turn" in run.space.names:
            at = run.space.names.index("turn")
            for x, c in zip(points, judged):
                x[at] = run.space.point(c.shape)[at]
        with warnings.catch_warnings():  # steering moves points on purpose
            warnings.simplefilter("ignore", cma.evolution_strategy.InjectionWarning)
            self._strategy.tell(points, cost.tolist())
        run.note_generation([judged[k] for k in better] or judged)
        self.best = min(self.best, *(judged[k] for k in better), key=Candidate.rank) if better else self.best


def steer(evaluator: Evaluator, space: Space, candidates: list[Candidate], times: int = STEERED) -> list[Candidate]:
    """Steers candidates that drift too much against their drift, and keeps the change where it makes them better: how much a gait
    turns is known from its run, and need not be searched for. First by as much as it turns, then by the secant of two runs,
    `times` in all."""
    request, out = evaluator.request, list(candidates)
    if "turn" not in space.names or request.way == "turn":
        return out
    low, high = (float(end[space.names.index("turn")]) for end in (space.low, space.high))
    before: dict[int, Candidate] = {}
    last = dict(enumerate(candidates))
    for _ in range(times):
        tried = {}
        for k, c in last.items():
            if c.nominal is not None and not c.nominal.fell and any(m.kind == "straying" and m.use > 1 for m in c.margins):
                tried[k] = replace(c.shape, turn=float(np.clip(_straight(request, c, before.get(k)), low, high)))
        before = last
        last = dict(zip(tried, evaluator.judge(list(tried.values()), 0)))
        for k, c in last.items():
            out[k] = min(out[k], c, key=Candidate.rank)
    return out


def _straight(request: Request, c: Candidate, before: Candidate | None) -> float:
    """The `turn` with which a gait should not turn more than required, from one run of it or two."""
    assert c.nominal is not None
    excess = excess_turning(request, c.nominal)
    if before is not None and before.nominal is not None and not before.nominal.fell:
        change = excess - excess_turning(request, before.nominal)
        turned = c.shape.turn - before.shape.turn
        if change * turned > 0:
            return c.shape.turn - excess * turned / change
    return c.shape.turn - excess * c.table.period * c.shape.duty
