"""From a request to a certified table."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, get_args

from workbench.files import InputError
from workbench.files.option_checks import check_choice, check_whole
from workbench.files.reading import write_together
from workbench.gait.certificate import MARK, NAME
from workbench.gait.certify import Certified, CertifyOptions, Examination, OtherEngine
from workbench.gait.draws import FEWEST
from workbench.gait.ensemble import Ensemble
from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.feasibility import has_nearest, out_of_reach
from workbench.gait.finalists import Screening, finalists
from workbench.gait.limits import Margin, binding, violation
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure, measure
from workbench.gait.plan_compare import PlanComparison, compare_plan
from workbench.gait.plan_method import Plans, choose_plan, plan_entry, plans_of
from workbench.gait.planned import planned_seeds
from workbench.gait.refine import RefineOptions, refine
from workbench.gait.request import Request
from workbench.gait.search import Budget, Found, keeps_all_but_speed, search
from workbench.gait.shape import GaitShape
from workbench.gait.table import GaitTable, gait_table
from workbench.motion import Motion, load_motion
from workbench.motion.files import motion_text
from workbench.robot import RobotModel, data_file
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.types import Progress

WALK = "robotis_walk.csv"
"""The vendor's walk, whose speed is the one to keep where a request does not say another."""
Method = Literal["search", "plan", "both"]
MEMORY = ".rollouts.jsonl"
"""Where a folder remembers what its searches have simulated."""


IN_HAND = 0.05
"""By which a search goes beyond the required speed, which the certificate asks for after its numerical floor."""
DRIFT_SOUGHT = 10.0
"""Multiple of the drift limit on the nominal robot that a search allows: a steady turn is trimmed afterwards."""
SCREENED = 1_000_000
"""Seed of the finalists' robots, beyond those of searches and certificates."""
FIRST_LOOK = Budget(seeds=60, screened=6, starts=2, generations=4, draws=4)
"""Effort of the search for an achievable value after a refusal, half a minute."""
BRIEFLY = CertifyOptions(draws=8, checked=0, seconds=3.0, floor_seconds=1.5, variants=("2 ms", "1 ms", "0.5 ms"))
"""Reduced examination of the nearest table after a refusal, so that a refusal comes within a minute."""


@dataclass(frozen=True)
class OptimizeOptions:
    """How long and from where a gait is searched for. budget: size of the search. certify: the examination at the end. seed: of
    the search; the draws of the search and those of the certificate come from it and differ. n_jobs: threads and processes that
    simulate. given: gaits to start from; planned: whether the search also starts from solved kino-centroidal programmes.
    screening: how the search's best are tried on fresh robots before the certificate. method: "search"; "plan": the joint paths
    of solved programmes as tables, without a search; "both": a search that begins at those, too.
    refine: Gauss-Newton on the best gait's joint angles afterwards.
    InputError for a number out of range, or a method that is not known."""

    budget: Budget = field(default_factory=Budget)
    certify: CertifyOptions = field(default_factory=CertifyOptions)
    seed: int = 0
    n_jobs: int = 2
    given: tuple[GaitShape, ...] = ()
    planned: bool = True
    screening: Screening = field(default_factory=Screening)
    method: Method = "search"
    refine: RefineOptions = field(default_factory=RefineOptions)

    def __post_init__(self) -> None:
        check_whole(self, seed=0, n_jobs=1)
        check_choice("method", self.method, get_args(Method))


@dataclass(frozen=True)
class Optimized:
    """Result of a search.

    request: that was searched. met: whether the gait keeps every limit and the required speed. problem: where it does not, in
    a line: the binding limit, and the achievable value. table: poses in counts and milliseconds (`cycle`, `start` from neutral,
    `stop`); certified: its certificate and the takes of the nominal robot; both of the gait, or of the nearest that keeps every
    limit, or None where there is none. found: how the search ended (best gait, generations, rollouts); None where no search was
    needed. plan: of a planned gait, its plan and its motion.
    """

    request: Request
    met: bool
    problem: str
    table: GaitTable | None
    certified: Certified | None
    found: Found | None
    plan: PlanComparison | None = None


def optimize(machine: GaitMachine, request: Request, ensemble: Ensemble, options: OptimizeOptions, progress: Progress,
             memory: Path | None = None, other: tuple[str, OtherEngine] | None = None) -> Optimized:
    """Searches for a gait and certifies it. memory: a file from which a run that was killed continues; the same request with the
    same seed and code ends in the same table."""
    impossible = out_of_reach(machine, request)
    if impossible is not None:
        return _instead(machine, request, impossible, ensemble, options, progress, other)
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        draws = _Draws(ensemble, machine.model, options, Path(folder))
        began = time.monotonic()
        evaluator = Evaluator(machine, sought(request), draws.searching(), memory, options.n_jobs)
        plans = Plans() if options.method == "search" else plans_of(evaluator, progress)
        found = _sought(evaluator, options, plans, progress)
        if found is None:
            return Optimized(request, False, f"{request}: none of {plans.asked} programmes has a table", None, None, None)
        before, found = found, refine(evaluator, found, options.refine, progress)
        plans = plans.with_refined(before, found)
        provenance: dict[str, Any] = {
            "workbench": version("drake-workbench"), "drake": version("drake"), "seed": options.seed,
            "ensemble": Path(ensemble.source).name, "ensemble_sha256": ensemble.sha256, "method": options.method,
            "generations": found.generations, "rollouts": found.rollouts, "refined": found.best is not before.best,
            "searched in": round(time.monotonic() - began, 1)}

        def examine(c: Candidate, examined: CertifyOptions, finalist: int) -> Examination:
            origin = {**provenance, "finalist": finalist, **plan_entry(c, plans)}
            table = gait_table(machine, c.shape)
            return Examination(machine, request, table, draws.certifying(), examined, progress, origin, other)

        def finish(met: bool, problem: str, table: GaitTable, certified: Certified, found: Found) -> Optimized:
            planned = plans.of(table.shape)
            comparison = (None if planned is None else
                          compare_plan(machine, planned, table, certified.take, certified.cycles))
            return Optimized(request, met, problem, table, certified, found, comparison)

        refused: list[Candidate] = []
        examined: list[Examination] = []
        tried = finalists(machine, request, found, draws.screening(), options.screening, options.certify, memory, options.n_jobs,
                          progress)
        for k, walked in enumerate(tried):
            if not walked.good:
                progress(f"finalist {k + 1} is refused: {binding(walked.margins)}", None)
                refused.append(walked)
                continue
            examined.append(examine(walked, options.certify, k + 1))
            broken = examined[-1].refusal
            if broken is None:
                certified = examined[-1].finish()
                if certified.certificate.kept:
                    return finish(True, "", examined[-1].table, certified, replace(found, best=walked))
                broken = binding(certified.certificate.margins)
            progress(f"finalist {k + 1} is not certified: {broken}", None)
            if len(examined) == options.screening.certified:
                break
        if examined:  # none is certified: the rest of each examination says which is nearest
            best = min(examined, key=lambda e: violation(e.finish().certificate.margins))
            return finish(False, _unmet(request, best.finish().certificate.margins, None), best.table, best.finish(), found)
        binds = min(refused, key=Candidate.rank, default=found.best)
        nearest = _nearest(found, refused)
        problem = _unmet(request, binds.margins, nearest)
        if nearest is None:
            return Optimized(request, False, problem, None, None, found)
        brief = examine(nearest, _briefly(options.certify), 0)
        return finish(False, problem, brief.table, brief.finish(), found)


def _sought(evaluator: Evaluator, options: OptimizeOptions, plans: Plans, progress: Progress) -> Found | None:
    """Result of a method; None where no plan led to a table."""
    if options.method == "plan":
        return choose_plan(evaluator, plans, progress)
    if options.planned:
        progress("planning seeds", 0.0)
    planned = planned_seeds(evaluator.machine, evaluator.request) if options.planned else ()
    return search(evaluator, options.budget, options.seed, progress, (*options.given, *plans.shapes, *planned))


@dataclass(frozen=True)
class _Draws:
    """Robots of the ensemble for each stage of a request, none of which meets another stage's."""

    ensemble: Ensemble
    model: RobotModel
    options: OptimizeOptions
    folder: Path

    def searching(self) -> list[RobotModel]:
        """Robots for the search, floor and supply spread evenly."""
        return self.ensemble.draws(self.model, self.options.budget.draws, 2 * self.options.seed, self.folder, even=True)

    def screening(self) -> list[RobotModel]:
        """Robots for the finalists."""
        count = max(self.options.screening.rounds, default=0)
        return self.ensemble.draws(self.model, count, SCREENED + self.options.seed, self.folder)

    def certifying(self) -> list[RobotModel]:
        """Robots for the certificate."""
        return self.ensemble.draws(self.model, self.options.certify.draws, 2 * self.options.seed + 1, self.folder)


def _nearest(found: Found, refused: Sequence[Candidate]) -> Candidate | None:
    """The fastest gait that keeps every limit but the speed, if there is one; as the certificate walks rather than as the search
    does."""
    slow = [c for c in refused if c.nominal is not None and keeps_all_but_speed(c)]
    return min(slow, key=Candidate.rank, default=found.nearest)


def _briefly(options: CertifyOptions) -> CertifyOptions:
    """No more than BRIEFLY."""
    least = {f: min(getattr(options, f), getattr(BRIEFLY, f)) for f in ("draws", "checked", "seconds", "floor_seconds")}
    return replace(options, variants=tuple(v for v in options.variants if v in BRIEFLY.variants), **least)


def sought(request: Request) -> Request:
    """The requirements of a search: more speed than requested, so that its gait keeps the request in the certificate's longer and
    finer runs, too, and straight enough to be trimmed."""
    speed = None if request.speed is None else request.speed * (1 + IN_HAND)
    return replace(request, speed=speed, limits=replace(request.limits, drift=DRIFT_SOUGHT * request.limits.drift))


def _instead(machine: GaitMachine, request: Request, impossible: Margin, ensemble: Ensemble, options: OptimizeOptions,
             progress: Progress, other: tuple[str, OtherEngine] | None) -> Optimized:
    """The answer to a speed that no gait has: the nearest table, after a first search for the fastest. On a slope on which
    nothing stands, with servos that may not even hold it up, or to a speed in another unit there is none."""
    problem = f"cannot be met by any gait: {impossible}"
    if not has_nearest(impossible):
        return Optimized(request, False, problem, None, None, None)
    progress(f"{problem}; looking for the nearest that works", None)  # before the search, which takes half a minute
    look = replace(options, method="search", refine=RefineOptions(iterations=0), budget=FIRST_LOOK,
                   certify=_briefly(options.certify))
    nearest = optimize(machine, replace(request, speed=None, aim="speed"), ensemble, look, progress, None, other)
    if nearest.found is not None and nearest.found.best.good:
        problem += f"; the nearest table in a quick search reaches {_speed(request, nearest.found.best)}"
    return Optimized(request, False, problem, nearest.table, nearest.certified, nearest.found)


def walk_speed(model: RobotModel) -> float:
    """Speed of the ROBOTIS walk on this robot [m/s], in its servos. InputError for a robot that cannot play it forwards."""
    speed = robotis_walk(model).speed
    if speed <= 0:
        raise InputError(None, "the ROBOTIS walk does not go forwards on this robot; expected a speed (--speed V)")
    return speed


def robotis_walk(model: RobotModel) -> GaitMeasure:
    """The ROBOTIS walk on this robot in six seconds. InputError for a robot that does not have its joints."""
    try:
        motion = load_motion(data_file(WALK), model)
    except InputError:
        raise InputError(None, "the ROBOTIS walk is not for this robot; expected a speed (--speed V)") from None
    take = simulate_batch([Job(model, SimulationConfig(base="free"), motion.commands(13), 6.0)])[0]
    return measure(take, model, motion.duration, motion.duration)


def gait_files(table: GaitTable, certified: Certified) -> dict[str, str]:
    """Names and contents: the motion from power-on to standstill, as long as it was walked for the certificate, and that."""
    motion = replace(Motion.from_table(table.whole), cycles=certified.cycles)
    return {"gait.csv": motion_text(motion, MARK), NAME: certified.certificate.as_text()}


def write_gait(folder: Path, table: GaitTable, certified: Certified) -> list[Path]:
    """Writes them, all or none."""
    return write_together(folder, gait_files(table, certified))


def _unmet(request: Request, margins: Sequence[Margin], nearest: Candidate | None) -> str:
    """One line: the binding limit, its excess, and the achievable value."""
    problem = f"{request}: not met"
    limit = binding(_without_speed(margins))
    if limit is not None:
        problem += f"; {limit} binds" + (f" ({100 * (limit.use - 1):+.0f} %)" if limit.limit else "")
    if nearest is not None:
        problem += f"; the nearest table that keeps every limit reaches {_speed(request, nearest)}"
    return problem


def _without_speed(margins: Sequence[Margin]) -> list[Margin]:
    """The margins that keep a gait from being faster, where any is at its limit."""
    tight = [m for m in margins if m.kind != "speed" and m.use > 0.97 and not m.advice]
    return tight or list(margins)


def _speed(request: Request, c: Candidate) -> str:
    assert c.nominal is not None
    value = request.progress(c.nominal)
    return f"{math.degrees(value):.0f} deg/s" if request.way == "turn" else f"{value:.2f} m/s"


def options_of(effort: int, seed: int = 0, n_jobs: int = 2) -> OptimizeOptions:
    """Options for an effort: 1 is a first look with few draws, 4 the default, beyond that the search is longer."""
    budget, examined = Budget(), CertifyOptions(n_jobs=n_jobs)
    scale = effort / 4
    budget = replace(budget, seeds=round(budget.seeds * min(scale, 2.0)), generations=max(3, round(budget.generations * scale)),
                     draws=4 if effort == 1 else budget.draws)
    if effort == 1:
        examined = replace(examined, draws=FEWEST, checked=0, seconds=4.0)
    return OptimizeOptions(budget, examined, seed, n_jobs, refine=RefineOptions(iterations=1 if effort == 1 else 2))
