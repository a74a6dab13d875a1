"""The search for a gait: random seeds, then CMA-ES over the ensemble, deterministic by seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cma
import numpy as np

from workbench.files.option_checks import check_positive, check_whole
from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.limits import Margin, binding
from workbench.gait.request import Request
from workbench.gait.requirements import excess_turning
from workbench.gait.shape import GaitShape
from workbench.gait.space import Space, seeds, space_of

STRAYING = ("drift", "curvature off the arc")
"""Limits that steering can keep."""
STEERED = 2
"""How often a gait is steered before the next generation."""
APART = 0.4
"""Distance in the unit cube from which two gaits differ, less than half of what two of a first generation are apart: how a gait
stands other robots hangs on small things, so that it is looked for in many."""
NARROW = 0.5
"""Width of the search over the ensemble, by that on the nominal robot: it begins at a good gait."""
FEW = 3 / 8
"""Share of the ensemble's robots on which half of a generation is tried, before the better half of that is tried on all."""
Progress = Callable[[str, float | None], None]


@dataclass(frozen=True)
class Budget:
    """Size of the search, in numbers of gaits and not in seconds, so that the same seed ends in the same table. InputError for a
    number out of range.

    seeds: random gaits at first. starts: the best of them, of different families or knees, from which CMA-ES goes on.
    population, generations: of each start, on the nominal robot; then `robust` generations, over `draws` robots of the
    ensemble, from the one that does best on them of `pool` good gaits that differ. width: first standard deviation in the
    unit cube. enough: a search for a given speed ends after so many generations in a row that kept every limit. hopeless: it
    ends before the ensemble comes in if the best gait has less than this share of the speed, which no robust generations have
    been seen to make up for. finalists: gaits that may go to the certificate.
    """

    seeds: int = 100
    starts: int = 3
    population: int = 12
    generations: int = 12
    robust: int = 24
    draws: int = 16
    pool: int = 12
    width: float = 0.15
    enough: int = 3
    hopeless: float = 0.6
    finalists: int = 12

    def __post_init__(self) -> None:
        check_whole(self, seeds=1, starts=1, population=2, generations=0, robust=0, draws=0, pool=1, enough=1, finalists=1)
        check_positive(self, "width")


@dataclass(frozen=True)
class Found:
    """What a search ended with. best: the best gait; nearest: the best that keeps all limits but the required speed, if `best`
    does not keep that; generations and rollouts: how many it took; others: that keep every limit, too, the best first."""

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
    """Searches for a gait for the evaluator's request. given: shapes to start from, beside the random ones."""
    space = space_of(evaluator.machine, evaluator.request)
    run = _Run(evaluator, budget, space, progress)
    shapes = [*given, *seeds(evaluator.machine, evaluator.request, space, budget.seeds, seed)]
    started = run.seeded(shapes)
    runs = [_Refiner(run, c, seed + 1 + k, budget.width) for k, c in enumerate(started)]
    for k in range(budget.generations * len(runs)):
        runs[k % len(runs)].generation(0)
        if run.enough():
            break
    if budget.robust and evaluator.draws and not run.hopeless():
        refiner = _Refiner(run, run.most_robust(runs), seed + 1 + len(runs), NARROW * budget.width)
        for _ in range(budget.robust):
            refiner.generation(budget.draws)
            if run.enough():
                break
    assert run.best is not None
    return Found(run.best, run.nearest, run.generation, evaluator.rollouts, run.others())


class _Run:
    """What is known so far."""

    def __init__(self, evaluator: Evaluator, budget: Budget, space: Space, progress: Progress) -> None:
        self.evaluator, self.budget, self.space, self.progress = evaluator, budget, space, progress
        self.best: Candidate | None = None
        self.nearest: Candidate | None = None
        self.generation = 0
        self._streak = 0
        self._robust = False
        self._good: list[Candidate] = []
        robust = budget.robust if evaluator.draws else 0
        self._all = budget.starts * budget.generations + robust

    def seeded(self, shapes: Sequence[GaitShape]) -> list[Candidate]:
        """The best seeds, each of another family or another way of the knees."""
        judged: list[Candidate] = []
        for k in range(0, len(shapes), 40):
            self.progress(f"seeds {k} of {len(shapes)}{self._told()}", 0.0)
            judged += steered(self.evaluator, self.space, self.evaluator.judged(shapes[k:k + 40], 0))
            self._note(judged[k:])
        out: list[Candidate] = []
        for c in sorted(judged, key=Candidate.rank):
            if all((c.shape.family, c.shape.knees) != (o.shape.family, o.shape.knees) for o in out):
                out.append(c)
        return out[:self.budget.starts]

    def note_generation(self, candidates: list[Candidate]) -> None:
        """After a generation: keeps the best, reports it."""
        self._note(candidates)
        self.generation += 1
        assert self.best is not None
        self._streak = self._streak + 1 if self.best.good else 0
        self.progress(f"generation {self.generation} of {self._all}{self._told()}", self.generation / self._all)

    def most_robust(self, runs: Sequence[_Refiner]) -> Candidate:
        """Of the best of each run, and of good gaits that differ, the one that does best on the ensemble; from here on only what
        was tried on it counts."""
        pool = self._different([r.best for r in runs])
        self.progress(f"ensemble: {len(pool)} gaits on {self.budget.draws} robots{self._told()}", None)
        self._streak, self._robust, self._good, self.best, self.nearest = 0, True, [], None, None
        tried = raced(self.evaluator, pool, self.budget.draws, all_of_them=True)
        self._note(tried)
        first = tried[_ordered(tried)[0]]
        self.best = self.best or first
        return first

    def _different(self, pool: list[Candidate]) -> list[Candidate]:
        """These, and the best of what kept all limits so far, as long as they are apart from those before them."""
        for c in sorted(self._good, key=Candidate.rank):
            if len(pool) >= self.budget.pool:
                break
            alike = [o for o in pool if (o.shape.family, o.shape.knees) == (c.shape.family, c.shape.knees)]
            point = self.space.point(c.shape)
            if all(np.linalg.norm(point - self.space.point(o.shape)) > APART for o in alike):
                pool.append(c)
        return pool

    def others(self) -> tuple[Candidate, ...]:
        """What keeps every limit beside the best."""
        return tuple(c for c in sorted(self._good, key=Candidate.rank) if c is not self.best)[:self.budget.finalists - 1]

    def hopeless(self) -> bool:
        """Whether the required speed is far from what was found."""
        asked, found = self.evaluator.request.speed, self.nearest or self.best
        if asked is None or found is None or found.nominal is None:
            return False
        return self._speed(found) < self.budget.hopeless * asked

    def enough(self) -> bool:
        """Whether a search for a given speed may stop."""
        request = self.evaluator.request
        return request.speed is not None and request.aim == "speed" and self._streak >= self.budget.enough

    def _note(self, candidates: list[Candidate]) -> None:
        told = [c for c in candidates if len(c.draws) >= self.budget.draws or not self._robust]
        self._good += [c for c in told if c.good]
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

    def __init__(self, run: _Run, start: Candidate, seed: int, width: float) -> None:
        self._run, self._family, self._knees = run, start.shape.family, start.shape.knees
        self.best = start
        options = {"popsize": run.budget.population, "seed": seed, "bounds": [0.0, 1.0], "verbose": -9, "verb_log": 0,
                   "integer_variables": [], "maxiter": 10**6, "tolstagnation": 10**6, "tolfun": 0, "tolx": 0, "tolfunhist": 0}
        x0 = np.clip(run.space.point(start.shape), 0.02, 0.98)
        self._strategy = cma.CMAEvolutionStrategy(x0, width, options)

    def generation(self, draws: int) -> None:
        """One generation, on the nominal robot, and what is best of it on `draws` more."""
        run = self._run
        points = [np.asarray(x) for x in self._strategy.ask()]
        judged = run.evaluator.judged([run.space.shape(x, self._family, self._knees) for x in points], 0)
        judged = steered(run.evaluator, run.space, judged)
        if draws:
            judged = raced(run.evaluator, judged, draws)
        order = _ordered(judged)
        cost = np.empty(len(judged))
        cost[order] = np.arange(len(judged))
        if "turn" in run.space.names:
            for x, c in zip(points, judged):
                x[run.space.names.index("turn")] = run.space.point(c.shape)[run.space.names.index("turn")]
        self._strategy.tell(points, cost.tolist())
        run.note_generation(judged)
        self.best = min(self.best, *judged, key=Candidate.rank)


def steered(evaluator: Evaluator, space: Space, candidates: list[Candidate]) -> list[Candidate]:
    """Those that drift too much steered against it where that makes them better: how much a gait turns is known from its run, and
    need not be searched for. First by as much as it turns, then by the secant of two runs."""
    request, out = evaluator.request, list(candidates)
    if "turn" not in space.names or request.way == "turn":
        return out
    low, high = (float(end[space.names.index("turn")]) for end in (space.low, space.high))
    before: dict[int, Candidate] = {}
    last = dict(enumerate(candidates))
    for _ in range(STEERED):
        tried = {}
        for k, c in last.items():
            if c.nominal is not None and not c.nominal.fell and any(m.name in STRAYING and m.use > 1 for m in c.margins):
                tried[k] = replace(c.shape, turn=float(np.clip(_straight(request, c, before.get(k)), low, high)))
        before = last
        last = dict(zip(tried, evaluator.judged(list(tried.values()), 0)))
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


def raced(evaluator: Evaluator, candidates: list[Candidate], draws: int, all_of_them: bool = False) -> list[Candidate]:
    """The candidates with their better half, or all, tried on some robots of the ensemble, and the best quarter on `draws`."""
    out = list(candidates)
    for count, share in ((max(1, round(FEW * draws)), 1 if all_of_them else 2), (draws, 4)):
        kept = _ordered(out)[:-(-len(out) // share)]
        for k, c in zip(kept, evaluator.judged([out[k].shape for k in kept], count)):
            out[k] = c
    return out


def _ordered(candidates: list[Candidate]) -> list[int]:
    """Indices, the best first; one that was tried on more robots comes before others."""
    return sorted(range(len(candidates)), key=lambda k: (-len(candidates[k].draws), *candidates[k].rank()))
