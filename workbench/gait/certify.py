"""Simulates everything that a certificate states."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from joblib import delayed

from workbench.files import InputError
from workbench.gait.certificate import Certificate, hashes
from workbench.gait.draws import Drawn, draw_margins, slip_margin
from workbench.gait.draws import summary as draw_summary
from workbench.gait.examine import CertifyOptions, Examiner, NominalRun, OtherEngine, vendor_table
from workbench.gait.feet import FeetMeasure
from workbench.gait.limit_cycle import LimitCycle
from workbench.gait.limits import (
    Margin,
    binding,
    contact_margin,
    return_margin,
    run_margins,
    table_margins,
    violation,
)
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure
from workbench.gait.record import Nominal, Steadiness
from workbench.gait.request import Request
from workbench.gait.requirements import direction_margins, drift, floor_margins, speed_margins
from workbench.gait.second_engine import conditions
from workbench.gait.second_engine import margins as engine_margins
from workbench.gait.second_engine import summary as engines_summary
from workbench.gait.straighten import PROBED, Straightener, summary_of_straightened, trim_margin, turn_response
from workbench.gait.table import GaitTable
from workbench.recording.take import Take
from workbench.robot import GRAVITY, RobotModel
from workbench.simulation.cluster import stream_results
from workbench.types import Progress

__all__ = ["Certified", "CertifyOptions", "Examination", "OtherEngine", "certify"]

Work = tuple[str, Callable[..., Any], tuple[Any, ...]]
"""A simulation, in words, and the function that runs it."""

TOGETHER = 4
"""Robots that a process simulates in one call: each call sends it the table and options anew."""


@dataclass(frozen=True)
class Certified:
    """A certificate, the take of the nominal robot that it speaks of, its cycles from power-on to standstill, and the request."""

    certificate: Certificate
    take: Take
    cycles: int
    request: Request


def certify(machine: GaitMachine, request: Request, table: GaitTable, draws: Sequence[RobotModel], options: CertifyOptions,
            progress: Progress, provenance: dict[str, Any], other: tuple[str, OtherEngine] | None = None) -> Certified:
    """Simulates a table on the request's robot, and states which limits it keeps. Arguments as of `Examination`."""
    return Examination(machine, request, table, draws, options, progress, provenance, other).finish()


class Examination:
    """The examination of a table, in two parts: the nominal robot and those of the ensemble, which refuse most gaits that are
    refused; then numerical floor, other engines, way back to the cycle and straightening, which take longer. Each part is
    simulated when it is first asked for.

    draws: robots of the ensemble that the search has not seen. provenance: entries for the certificate, to which the time taken
    is added [s]. other: name of a second engine, and the engine."""

    def __init__(self, machine: GaitMachine, request: Request, table: GaitTable, draws: Sequence[RobotModel],
                 options: CertifyOptions, progress: Progress, provenance: dict[str, Any],
                 other: tuple[str, OtherEngine] | None = None) -> None:
        self.machine, self.request, self.table, self.options, self.other = machine, request, table, options, other
        self._progress, self._provenance = progress, provenance
        self._examiner = Examiner(request.on_slope(machine.model), machine.legs, table, options)
        self._robots = [request.on_slope(d) for d in draws[:options.draws]]

    @cached_property
    def refusal(self) -> Margin | None:
        """The worst limit that the nominal robot and those of the ensemble break; None if they keep all."""
        margins = self._on_robots.margins
        return binding(margins) if violation(margins) > 0 else None

    @cached_property
    def _on_robots(self) -> _OnRobots:
        """The first part."""
        machine, request, limits = self.machine, self.request, self.request.limits
        began, groups = time.monotonic(), _groups(self._robots)
        results = self._run({
            "nominal": [("nominal robot", self._examiner.nominal, ())],
            "robots": [(f"robot {k * TOGETHER + 1} of {len(self._robots)}", self._examiner.robots, (g,))
                       for k, g in enumerate(groups)]})
        run: NominalRun = results["nominal"][0]
        drawn = [d for group in results["robots"] for d in group]
        nominal, on_draws = run.measure, [d.measure for d in drawn]
        margins = (*table_margins(machine, self.table, limits), contact_margin(run.near, limits),
                   *run_margins(machine, nominal, limits), slip_margin(machine, request, nominal),
                   *direction_margins(request, nominal), *speed_margins(request, nominal, on_draws),
                   *draw_margins(machine, request, on_draws))
        return _OnRobots(run, drawn, margins, time.monotonic() - began)

    def finish(self) -> Certified:
        """The certificate, after both parts."""
        return self._certified

    @cached_property
    def _certified(self) -> Certified:
        machine, request, options, other = self.machine, self.request, self.options, self.other
        first, robots, began = self._on_robots, self._robots, time.monotonic()
        probed = robots[-PROBED:] if len(robots) > 2 * PROBED else []  # others than those that are straightened
        straightener = _straightener(machine, request, self.table, probed) if robots and options.trimmed else None
        trimmed = _groups(robots[:min(options.trimmed, len(robots) - len(probed))]) if straightener is not None else []
        variants = sorted(options.variants, key=lambda v: v != "hydroelastic")  # longest first, so that all cores end together
        conditioned = () if other is None else conditions()
        examiner = self._examiner
        results = self._run({
            "variants": [(f"numerics, {v}", examiner.variant, (v,)) for v in variants],
            "elsewhere": [] if other is None else [
                (f"in {other[0]}: {c.name}", examiner.elsewhere, (other[1], c)) for c in conditioned],
            "in Drake": [(f"robot {k + 1} of {len(robots)} in Drake", examiner.compare_engines, (r,))
                         for k, r in enumerate(robots[:options.checked])],
            "cycle": [("back to its cycle", examiner.limit_cycle, (vendor_table(machine.model),))] if options.watched else [],
            "straightened": [(f"robots straightened, {len(g)}", straightener.robots, (g,)) for g in trimmed if straightener]})
        run = first.run
        floor = _floor(request, dict(zip(variants, results["variants"])))
        pairs = {c.name: pair for c, pair in zip(conditioned, results["elsewhere"])}
        cycle: LimitCycle | None = results["cycle"][0] if options.watched else None
        walks = [w for group in results["straightened"] for w in group]
        draw_results = draw_summary(request, first.drawn)
        if straightener is not None:
            draw_results["straightened"] = summary_of_straightened(walks, straightener.response.nominal_gain)
        if results["in Drake"]:
            draw_results["the same in Drake"] = _compare_with_drake(request, results["in Drake"], options)
        margins = [*first.margins, *floor_margins(request, run.measure, floor),
                   *([] if cycle is None else [return_margin(cycle, request.limits)]),
                   *([trim_margin(request, walks)] if robots and options.trimmed and request.way != "turn" else [])]
        margins += [] if other is None else engine_margins(request, other[0], pairs, options.compared)
        certificate = Certificate(
            kept=violation(margins) == 0.0, request=str(request), asked=request.to_plain(),
            tables=hashes(gait=self.table.whole), model_sha256=machine.model.sha256, margins=tuple(margins),
            nominal=_numbers(machine, request, run.measure, run.feet), draws=draw_results, floor=floor,
            other_engine={} if other is None else engines_summary(request, other[0], pairs), ways=run.ways,
            cycle=_cycle(cycle, run.measure, [d.measure for d in first.drawn]), shape=asdict(self.table.shape),
            provenance={**self._provenance, "certified in": round(first.seconds + time.monotonic() - began, 1)})
        return Certified(certificate, run.take, run.cycles, request)

    def _run(self, work: Mapping[str, Sequence[Work]]) -> dict[str, list[Any]]:
        """Results of a part's simulations by group."""
        return _run(work, self.options.n_jobs, self._progress)


@dataclass(frozen=True)
class _OnRobots:
    """Results of an examination's first part, the limits they show, and the time it took [s]."""

    run: NominalRun
    drawn: Sequence[Drawn]
    margins: tuple[Margin, ...]
    seconds: float


def _groups(robots: Sequence[RobotModel]) -> list[Sequence[RobotModel]]:
    """Robots in groups of TOGETHER, each for one process."""
    return [robots[k:k + TOGETHER] for k in range(0, len(robots), TOGETHER)]


def _straightener(machine: GaitMachine, request: Request, table: GaitTable, probed: Sequence[RobotModel]) -> Straightener | None:
    """What straightens robots that walk this table; None for a gait that cannot be steered. probed: robots on which the
    response is measured."""
    try:
        response = turn_response(machine, request, table.shape, probed)
    except InputError:
        return None
    return Straightener(machine.model, request, table.shape, response, request.limits.spread)


def _run(work: Mapping[str, Sequence[Work]], n_jobs: int, progress: Progress) -> dict[str, list[Any]]:
    """Runs groups of simulations in `n_jobs` processes; returns each group's results, in its order."""
    queue = [(group, *item) for group, items in work.items() for item in items]
    out: dict[str, list[Any]] = {group: [] for group in work}
    results = stream_results((delayed(f)(*args) for *_, f, args in queue), n_jobs, batch_size=1)
    for k, (group, what, *_) in enumerate(queue):
        progress(f"certifying: {what}", k / len(queue))
        out[group].append(next(results))
    return out


def _compare_with_drake(request: Request, checks: Sequence[tuple[GaitMeasure, GaitMeasure]], options: CertifyOptions
                        ) -> dict[str, Any]:
    """The certificate's entry on robots that both the compiled station and Drake played: how far their speeds are apart."""
    apart = np.array([request.progress(b) - request.progress(a) for a, b in checks])
    return {"count": len(checks), "seconds": options.checked_seconds, "step s": options.checked_step,
            "speed apart, RMS": float(np.sqrt((apart**2).mean()))}


def _cycle(cycle: LimitCycle | None, nominal: GaitMeasure, draws: Sequence[GaitMeasure]) -> Steadiness:
    """How evenly the gait repeats from cycle to cycle, and from which disturbances it returns to that."""
    walked = [math.degrees(m.scatter[1]) for m in draws if not m.fell and math.isfinite(m.scatter[1])]
    steadiness = Steadiness(nominal.scatter[0], math.degrees(nominal.scatter[1]), float(np.median(walked)) if walked else None)
    if cycle is None:
        return steadiness
    return replace(steadiness, watched=cycle.watched, back={r.entry: r.cycles for r in cycle.returns},
                   fell=tuple(r.entry for r in cycle.returns if r.fell))


def _floor(request: Request, measures: dict[str, GaitMeasure]) -> dict[str, Any]:
    """Speed and drift under other time steps and contact models, and how far they spread."""
    speeds = {k: request.progress(m) for k, m in measures.items()}
    drifts = {k: math.degrees(drift(request, m)) for k, m in measures.items()}
    steps = [v for k, v in speeds.items() if k.endswith("ms")] or [0.0]
    return {"speed": speeds, "heading deg/m": drifts, "steps": float(np.ptp(steps)),
            "all": float(np.std(list(speeds.values()))), "heading deg/m, all": float(np.std(list(drifts.values())))}


def _numbers(machine: GaitMachine, request: Request, m: GaitMeasure, feet: FeetMeasure) -> Nominal:
    weight, speed = machine.model.kinematics.mass * GRAVITY, max(float(np.hypot(*m.velocity)), 1e-6)
    return Nominal(
        speed=request.progress(m), unit=request.unit, heading=math.degrees(drift(request, m)), forward=m.velocity[0],
        left=m.velocity[1], turning=math.degrees(m.turn_rate), power=m.power, mechanical_power=m.mechanical,
        cost_of_transport=m.power / (weight * speed), mechanical_cost_of_transport=m.mechanical / (weight * speed),
        current=m.current, peak_current=m.peak_current, jerk=m.jerk, tilt=math.degrees(m.tilt), slip=feet.slip,
        clearance=1000 * feet.clearance, tipping=math.degrees(feet.tipping), rms=dict(zip(machine.model.joints, m.rms)))
