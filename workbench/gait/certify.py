"""Everything that a certificate says, found out by simulation."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from workbench.gait.certificate import Certificate, hashes
from workbench.gait.feet import FeetMeasure, feet_measure
from workbench.gait.limits import contact_margin, run_margins, table_margins, violation
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure, base_jerk, fallen, measure
from workbench.gait.request import Request
from workbench.gait.rollouts import Rollouts
from workbench.gait.table import GaitTable
from workbench.motion import Commands
from workbench.recording.take import Take
from workbench.robot import GRAVITY, RobotModel
from workbench.simulation import Job, SimulationConfig, simulate_batch

Array = NDArray[np.float64]
Progress = Callable[[str, float | None], None]
OtherEngine = Callable[[RobotModel, Commands, float], Take]
"""Plays commands for so many seconds on a robot, in an engine that shares no simulation code with this one."""

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)


@dataclass(frozen=True)
class CertifyOptions:
    """How a gait is examined. seconds: of walking on the nominal robot, six as in the thesis. draw_seconds: on each draw.
    draws: fresh ones. step: of the simulation, 1 ms [s]. checked: draws that Drake simulates as well, beside the nominal robot,
    which is always Drake's. floor_seconds: of each of the numerical `variants`. n_jobs: processes."""

    seconds: float = 6.0
    draw_seconds: float = 3.0
    draws: int = 64
    step: float = 1e-3
    checked: int = 8
    floor_seconds: float = 3.0
    variants: tuple[str, ...] = ("2 ms", "1 ms", "0.5 ms", "sap", "similar", "hydroelastic")
    n_jobs: int = 2


@dataclass(frozen=True)
class Certified:
    """A certificate and the take of the nominal robot that it speaks of."""

    certificate: Certificate
    take: Take
    whole: Take


def certify(machine: GaitMachine, request: Request, table: GaitTable, draws: Sequence[RobotModel], options: CertifyOptions,
            progress: Progress, provenance: dict[str, Any], other: tuple[str, OtherEngine] | None = None) -> Certified:
    """Examines a table on the request's robot. draws: robots of the ensemble, fresh ones, not those of the search."""
    began = time.monotonic()
    examiner = _Examiner(machine, request, table, options, progress)
    take, nominal, feet = examiner.nominal()
    whole, ways = examiner.ways()
    told, on_draws = examiner.on_draws(draws[:options.draws])
    floor = examiner.floor()
    elsewhere = {} if other is None else examiner.elsewhere(*other, nominal)
    margins = [*table_margins(machine, table, request.limits), contact_margin(machine, table, request.limits),
               *run_margins(machine, nominal, request.limits), *request.strays(nominal), *request.wanted(nominal, on_draws)]
    certificate = Certificate(
        kept=violation(margins) == 0.0, request=str(request),
        tables=hashes(gait=table.cycle, start=table.start, stop=table.stop), model_sha256=machine.model.sha256,
        margins=tuple(margins), nominal=_numbers(machine, request, nominal, feet), draws=told, floor=floor,
        other_engine=elsewhere, ways=ways, shape=asdict(table.shape),
        provenance={**provenance, "certified in": round(time.monotonic() - began, 1)})
    return Certified(certificate, take, whole)


class _Examiner:
    def __init__(self, machine: GaitMachine, request: Request, table: GaitTable, options: CertifyOptions, progress: Progress
                 ) -> None:
        self.machine, self.request, self.table, self.options, self.progress = machine, request, table, options, progress
        self.model = request.on_slope(machine.model)

    def nominal(self) -> tuple[Take, GaitMeasure, FeetMeasure]:
        """The nominal robot, with contact forces."""
        self.progress("certifying: nominal robot", 0.0)
        config = SimulationConfig(time_step=self.options.step, engine="drake")
        (take,) = simulate_batch([self._job(self.model, config, self.options.seconds, "optimised gait")])
        return take, *self._measured(take, self.model)

    def ways(self) -> tuple[Take, dict[str, Any]]:
        """In and out: a run of start, some cycles, stop, and a second at rest."""
        self.progress("certifying: the way in and out", 0.1)
        cycles = max(2, math.ceil(1.0 / self.table.period))
        commands = self.table.commands(cycles, whole=True)
        job = Job(self.model, SimulationConfig(time_step=self.options.step), commands, commands.end + 1.0, 0.3, name="in and out")
        (take,) = simulate_batch([job])
        assert take.p_WB is not None
        begin, end = self.table.start_seconds, commands.end - float(self.table.stop.dwells_ms.sum()) / 1000
        parts = {"start": (take.time >= 0) & (take.time < begin), "gait": (take.time >= begin) & (take.time < end),
                 "stop": take.time >= end}
        told: dict[str, Any] = {}
        for name, inside in parts.items():
            told[name] = {"seconds": float(np.ptp(take.time[inside])), "peak torque N m": float(_lasting(take, inside)),
                          "tilt deg": float(np.degrees(_tilt(take)[inside].max())),
                          "jerk of the base m/s^3": _jerk(take, inside)}
        rest = take.time > commands.end + 0.5
        told["at rest"] = {"speed m/s": float(np.abs(np.gradient(take.p_WB[rest], take.time[rest], axis=0)).max()),
                           "tilt deg": float(np.degrees(_tilt(take)[rest].max())),
                           "largest angle off neutral deg": float(np.degrees(np.abs(take.q[rest]).max()))}
        told["without a jerk"] = bool(max(told[k]["jerk of the base m/s^3"] for k in ("start", "stop"))
                                      <= 1.5 * told["gait"]["jerk of the base m/s^3"])
        return take, told

    def on_draws(self, draws: Sequence[RobotModel]) -> tuple[dict[str, Any], list[GaitMeasure]]:
        """Quantiles over robots nobody measured."""
        robots = [self.request.on_slope(d) for d in draws]
        config = SimulationConfig(time_step=self.options.step, contact_period=0.0, log_period=0.01)
        jobs = [self._job(r, config, self.options.draw_seconds) for r in robots]
        measures, feet = [], []
        for k, take in enumerate(Rollouts(self.options.n_jobs).takes(jobs)):
            self.progress(f"certifying: robot {k + 1} of {len(jobs)}", 0.2 + 0.6 * k / len(jobs))
            if take is None:
                measures.append(fallen(len(self.model.joints)))
            else:
                m, f = self._measured(take, robots[k])
                measures.append(m)
                feet.append(f)
        if not measures:
            return {"count": 0}, []
        r = self.request
        values = {
            f"speed {r.unit}": [r.progress(m) for m in measures],
            "heading deg/m": [math.degrees(r.drift(m)) for m in measures],
            "slip m/s": [f.slip for f in feet], "foot clearance mm": [1000 * f.clearance for f in feet],
            "tipping margin deg": [math.degrees(f.tipping) for f in feet],
            "electrical power W": [m.power for m in measures], "largest RMS torque N m": [max(m.rms) for m in measures]}
        told: dict[str, Any] = {k: _quantiles(np.array(v)) for k, v in values.items()}
        told["heading deg/m RMS"] = float(np.sqrt(np.mean(np.square(values["heading deg/m"]))))
        told |= {"count": len(measures), "falls": sum(m.fell for m in measures), "quantiles": list(QUANTILES)}
        if self.options.checked:
            told["the same in Drake"] = self._checked(robots[:self.options.checked], measures)
        return told, measures

    def floor(self) -> dict[str, Any]:
        """Steps and contact models."""
        base = SimulationConfig(time_step=self.options.step, contact_period=0.0, log_period=0.01)
        known = {"2 ms": {"time_step": 2e-3}, "1 ms": {"time_step": 1e-3}, "0.5 ms": {"time_step": 5e-4},
                 "sap": {"approximation": "sap"}, "similar": {"approximation": "similar"},
                 "hydroelastic": {"contact": "hydroelastic"}}
        variants = {name: replace(base, **known[name]) for name in self.options.variants}  # type: ignore[arg-type]
        self.progress(f"certifying: {len(variants)} ways to compute", 0.82)
        takes = simulate_batch([self._job(self.model, c, self.options.floor_seconds) for c in variants.values()],
                               self.options.n_jobs)
        measures = {k: self._measured(t, self.model)[0] for k, t in zip(variants, takes)}
        speeds = {k: self.request.progress(m) for k, m in measures.items()}
        drifts = {k: math.degrees(self.request.drift(m)) for k, m in measures.items()}
        steps = [v for k, v in speeds.items() if k.endswith("ms")] or [0.0]
        return {"speed": speeds, "heading deg/m": drifts, "steps": float(np.ptp(steps)),
                "all": float(np.std(list(speeds.values()))), "heading deg/m, all": float(np.std(list(drifts.values())))}

    def elsewhere(self, name: str, engine: OtherEngine, nominal: GaitMeasure) -> dict[str, Any]:
        """The same table in another engine."""
        self.progress(f"certifying: the same table in {name}", 0.92)
        commands, end = self._commands(self.options.seconds)
        m, feet = self._measured(engine(self.model, commands, end), self.model)
        r = self.request
        return {"name": name, "speed": r.progress(m), "speed kept": r.progress(m) / max(r.progress(nominal), 1e-9),
                "heading deg/m": math.degrees(r.drift(m)), "heading apart deg/m": math.degrees(r.drift(m) - r.drift(nominal)),
                "fell": m.fell, "slip m/s": feet.slip}

    def _checked(self, robots: Sequence[RobotModel], measures: Sequence[GaitMeasure]) -> dict[str, Any]:
        config = SimulationConfig(time_step=self.options.step, contact_period=0.0, log_period=0.01, engine="drake")
        takes = simulate_batch([self._job(r, config, self.options.draw_seconds) for r in robots], self.options.n_jobs)
        again = [self.request.progress(self._measured(t, r)[0]) for t, r in zip(takes, robots)]
        apart = np.array(again) - [self.request.progress(m) for m in measures[:len(robots)]]
        return {"count": len(robots), "speed apart, RMS": float(np.sqrt((apart**2).mean()))}

    def _measured(self, take: Take, model: RobotModel) -> tuple[GaitMeasure, FeetMeasure]:
        period = self.table.period
        begin = self.table.start_seconds + period  # as in the search, the heading settles in the first whole cycle
        feet = feet_measure(take, model, self.machine.legs, begin, period)
        return replace(measure(take, model, begin, period), clearance=feet.clearance), feet

    def _commands(self, seconds: float) -> tuple[Commands, float]:
        cycles = 1 + max(2, math.ceil(seconds / self.table.period))
        return self.table.commands(cycles), self.table.start_seconds + cycles * self.table.period

    def _job(self, model: RobotModel, config: SimulationConfig, seconds: float, name: str = "gait") -> Job:
        commands, end = self._commands(seconds)
        return Job(model, config, commands, end, 0.3, name=name)


def _numbers(machine: GaitMachine, request: Request, m: GaitMeasure, feet: FeetMeasure) -> dict[str, Any]:
    weight, speed = machine.model.kinematics.mass * GRAVITY, max(float(np.hypot(*m.velocity)), 1e-6)
    return {
        "speed": request.progress(m), "unit": request.unit, "heading deg/m": math.degrees(request.drift(m)),
        "forward m/s": m.velocity[0], "left m/s": m.velocity[1], "turning deg/s": math.degrees(m.turn_rate),
        "electrical power W": m.power, "mechanical power W": m.mechanical,
        "electrical cost of transport": m.power / (weight * speed),
        "mechanical cost of transport": m.mechanical / (weight * speed),
        "mean supply current A": m.current, "peak supply current A": m.peak_current, "jerk of the base m/s^3": m.jerk,
        "tilt deg": math.degrees(m.tilt), "slip m/s": feet.slip, "foot clearance mm": 1000 * feet.clearance,
        "tipping margin deg": math.degrees(feet.tipping),
        "RMS torque N m": dict(zip(machine.model.joints, m.rms))}


def _quantiles(values: Array) -> list[float]:
    return [float(x) for x in np.quantile(values, QUANTILES)]


def _tilt(take: Take) -> Array:
    assert take.quat_WB is not None
    _, x, y, _ = take.quat_WB.T
    return np.asarray(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1)))


def _lasting(take: Take, inside: NDArray[np.bool_]) -> float:
    """Largest joint torque that lasts 10 ms [N m]."""
    assert take.torque is not None
    every = float(np.median(np.diff(take.time)))
    return float(minimum_filter1d(np.abs(take.torque[inside]), max(1, round(0.01 / every)), axis=0).max())


def _jerk(take: Take, inside: NDArray[np.bool_]) -> float:
    assert take.p_WB is not None
    return base_jerk(take.time[inside], take.p_WB[inside])

