"""From a request to a certified table."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.files.option_checks import check_whole
from workbench.files.reading import write_together
from workbench.gait.certificate import MARK, NAME
from workbench.gait.certify import Certified, CertifyOptions, OtherEngine, Progress, certify
from workbench.gait.ensemble import Ensemble
from workbench.gait.evaluate import Candidate, Evaluator
from workbench.gait.finalists import finely
from workbench.gait.limits import Margin, binding
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure, measure
from workbench.gait.planned import planned_seeds
from workbench.gait.request import Request
from workbench.gait.search import Budget, Found, search
from workbench.gait.shape import GaitShape
from workbench.gait.table import GaitTable, gait_table
from workbench.motion import Motion, load_motion
from workbench.motion.files import motion_text
from workbench.robot import RobotModel, data_file
from workbench.simulation import Job, SimulationConfig, simulate_batch

WALK = "robotis_walk.csv"
"""The vendor's walk, whose speed is the one to keep where a request does not say another."""
MEMORY = ".rollouts.jsonl"
"""Where a folder remembers what its searches have simulated."""


IN_HAND = 0.02
"""By which a search goes beyond the required speed: twice what 2 ms and 1 ms differ by."""
DRIFT_SHARE = 0.6
"""Of the drift allowed that a search allows itself: over two seconds instead of six heading is less well known."""
SPREAD_SHARE = 0.7
"""Of the drift over draws allowed, likewise: other robots are drawn for the certificate."""
FIRST_LOOK = Budget(seeds=60, starts=2, generations=4, robust=0, draws=0)
"""Beside a refusal: what works instead, in half a minute."""
BRIEFLY = CertifyOptions(draws=8, checked=0, seconds=3.0, floor_seconds=1.5, variants=("2 ms", "1 ms", "0.5 ms"))
"""How the nearest table beside a refusal is examined at most, so that a refusal comes within a minute."""


@dataclass(frozen=True)
class OptimizeOptions:
    """How long and from where a gait is searched for. budget: size of the search. certify: the examination at the end. seed: of
    the search; the draws of the search and those of the certificate come from it and differ. n_jobs: threads and processes that
    simulate. given: gaits to start from; planned: whether the search also starts from solved kino-centroidal programmes.
    InputError for a number out of range."""

    budget: Budget = field(default_factory=Budget)
    certify: CertifyOptions = field(default_factory=CertifyOptions)
    seed: int = 0
    n_jobs: int = 2
    given: tuple[GaitShape, ...] = ()
    planned: bool = True

    def __post_init__(self) -> None:
        check_whole(self, seed=0, n_jobs=1)


@dataclass(frozen=True)
class Optimized:
    """Result of a search.

    request: what was searched for. met: whether the gait keeps every limit and the required speed. problem: where it does not, in
    a line: which limit binds, and what works. table: poses in counts and milliseconds (`cycle`, `start` from neutral, `stop`);
    certified: its certificate and the takes of the nominal robot; both of the gait, or of the nearest that keeps every limit, or
    None where there is none. found: how the search ended (best gait, generations, rollouts); None where no search was needed.
    """

    request: Request
    met: bool
    problem: str
    table: GaitTable | None
    certified: Certified | None
    found: Found | None


def optimize(machine: GaitMachine, request: Request, ensemble: Ensemble, options: OptimizeOptions, progress: Progress,
             memory: Path | None = None, other: tuple[str, OtherEngine] | None = None) -> Optimized:
    """Searches for a gait and certifies it. memory: a file from which a run that was killed continues; the same request with the
    same seed and code ends in the same table."""
    impossible = out_of_reach(machine, request)
    if impossible is not None:
        return _instead(machine, request, impossible, ensemble, options, progress, other)
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        draws = ensemble.draws(machine.model, options.budget.draws, 2 * options.seed, Path(folder))
        evaluator = Evaluator(machine, sought(request), draws, memory, options.n_jobs)
        if options.planned:
            progress("planning seeds", 0.0)
        planned = planned_seeds(machine, request) if options.planned else ()
        found = search(evaluator, options.budget, options.seed, progress, (*options.given, *planned))
        if not found.best.good:  # it may keep the request all the same, with a smaller reserve than the search requires
            again = Evaluator(machine, request, draws, memory, options.n_jobs)
            (best,) = again.judged([found.best.shape], options.budget.draws, list)
            found = replace(found, best=best) if best.good else found
        if found.best.good:
            progress("the best gaits as the certificate walks them", None)
            found = finely(machine, request, found, options.certify, memory, options.n_jobs)
        chosen = found.best if found.best.good else found.nearest
        if chosen is None:
            return Optimized(request, False, _unmet(request, found, None), None, None, found)
        fresh = ensemble.draws(machine.model, options.certify.draws, 2 * options.seed + 1, Path(folder))
        table = gait_table(machine, chosen.shape)
        provenance: dict[str, Any] = {
            "workbench": version("drake-workbench"), "drake": version("drake"), "seed": options.seed, "ensemble": ensemble.source,
            "ensemble_sha256": ensemble.sha256, "generations": found.generations, "rollouts": found.rollouts,
            "searched in": round(time.monotonic() - began, 1)}
        examined = options.certify if found.best.good else _briefly(options.certify)
        certified = certify(machine, request, table, fresh, examined, progress, provenance, other)
    met = found.best.good and certified.certificate.kept
    return Optimized(request, met, "" if met else _unmet(request, found, certified), table, certified, found)


def _briefly(options: CertifyOptions) -> CertifyOptions:
    """No more than BRIEFLY."""
    least = {f: min(getattr(options, f), getattr(BRIEFLY, f)) for f in ("draws", "checked", "seconds", "floor_seconds")}
    return replace(options, variants=tuple(v for v in options.variants if v in BRIEFLY.variants), **least)


def sought(request: Request) -> Request:
    """The requirements of a search, stricter than the request, so that its gait keeps the request in the certificate's longer and
    finer runs, too."""
    speed = None if request.speed is None else request.speed * (1 + IN_HAND)
    return replace(request, speed=speed, limits=replace(
        request.limits, drift=DRIFT_SHARE * request.limits.drift, spread=SPREAD_SHARE * request.limits.spread))


def _instead(machine: GaitMachine, request: Request, impossible: Margin, ensemble: Ensemble, options: OptimizeOptions,
             progress: Progress, other: tuple[str, OtherEngine] | None) -> Optimized:
    """Of a speed that no gait has: the nearest table, after a first look for the fastest. Up a slope on which nothing stands
    there is none."""
    said = f"cannot be met by any gait: {impossible}"
    if impossible.name == "slope":
        return Optimized(request, False, said, None, None, None)
    look = replace(options, budget=FIRST_LOOK, certify=_briefly(options.certify))
    nearest = optimize(machine, replace(request, speed=None, aim="speed"), ensemble, look, progress, None, other)
    if nearest.found is not None and nearest.found.best.good:
        said += f"; the nearest table that a first look found goes {_speed(request, nearest.found.best)}"
    return Optimized(request, False, said, nearest.table, nearest.certified, nearest.found)


def out_of_reach(machine: GaitMachine, request: Request) -> Margin | None:
    """What no gait can do, known before any search: speed beyond what feet reach at the servos' no-load speed, a slope beyond
    friction."""
    law = machine.law
    legs = {leg.foot: max(float(law.full_torque[i] / law.back_emf[i]) for i in map(machine.model.joints.index, leg.joints))
            for leg in machine.legs}
    if request.speed is not None:
        fastest = min(2 * legs[leg.foot] * leg.length for leg in machine.legs)  # two joints of a leg that add up
        if request.way == "turn":
            fastest /= min(float(np.hypot(*leg.neutral[:2])) for leg in machine.legs)
        if request.speed > fastest:
            return Margin("foot speed", "servos at no load", request.speed, fastest, request.unit, request.speed / fastest)
    friction = machine.model.ground.friction
    if friction is not None and math.tan(request.slope) > friction:
        bound = math.degrees(math.atan(friction))
        return Margin("slope", f"friction {friction:g}", math.degrees(request.slope), bound, "deg",
                      math.degrees(request.slope) / bound)
    return None


def walk_speed(model: RobotModel) -> float:
    """Speed of the ROBOTIS walk on this robot [m/s], in its servos. InputError for a robot that cannot play it forwards."""
    speed = robotis_walk(model).speed
    if speed <= 0:
        raise InputError(None, "the ROBOTIS walk does not go forwards on this robot; expected a speed (--speed V)")
    return speed


def robotis_walk(model: RobotModel) -> GaitMeasure:
    """What the ROBOTIS walk does on this robot in six seconds. InputError for a robot that has not its joints."""
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


def shape_from(content: dict[str, Any]) -> GaitShape:
    """The shape that a certificate holds."""
    return GaitShape(**{**content, "knees": tuple(content["knees"])})


def _unmet(request: Request, found: Found, certified: Certified | None) -> str:
    """In a line: what binds, by how much, and what works."""
    said = f"{request}: not met"
    limits: Sequence[Margin] = found.best.margins
    if found.best.good and certified is not None:
        limits = certified.certificate.margins
    limit = binding(_without_speed(limits, found)) if not found.best.good else binding(limits)
    if limit is not None:
        said += f"; {limit} binds" + (f" ({100 * (limit.use - 1):+.0f} %)" if limit.limit else "")
    if found.nearest is not None and not found.best.good:
        said += f"; the nearest table that keeps every limit goes {_speed(request, found.nearest)}"
    return said


def _without_speed(margins: Sequence[Margin], found: Found) -> list[Margin]:
    """Of a gait that is too slow: what keeps it from being faster, if something else is at its limit."""
    others = [m for m in margins if not m.name.startswith("speed")]
    tight = [m for m in others if m.use > 0.97 and not m.advice]
    return tight if tight and found.best.nominal is not None else list(margins)


def _speed(request: Request, c: Candidate) -> str:
    assert c.nominal is not None
    value = request.progress(c.nominal)
    return f"{math.degrees(value):.0f} deg/s" if request.way == "turn" else f"{value:.2f} m/s"


def options_of(effort: int, seed: int = 0, n_jobs: int = 2) -> OptimizeOptions:
    """Options for an effort: 1 is a first look with few draws, 4 the default, beyond that the search is longer."""
    budget, examined = Budget(), CertifyOptions(n_jobs=n_jobs)
    scale = effort / 4
    budget = replace(budget, seeds=round(budget.seeds * min(scale, 2.0)), generations=max(3, round(budget.generations * scale)),
                     robust=max(3, round(budget.robust * scale)), draws=4 if effort == 1 else budget.draws)
    if effort == 1:
        examined = replace(examined, draws=8, checked=0, seconds=4.0)
    return OptimizeOptions(budget, examined, seed, n_jobs)
