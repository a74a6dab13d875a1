"""The runs that a certificate is made of, each for itself, so that all cores share them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d

from workbench.files.option_checks import check_choice, check_positive, check_whole
from workbench.gait.feet import FeetMeasure, feet_measure
from workbench.gait.legs import Leg
from workbench.gait.measure import GaitMeasure, base_jerk, fallen, measure
from workbench.gait.rollouts import Rollouts
from workbench.gait.table import GaitTable
from workbench.motion import Commands
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import Job, SimulationConfig, simulate_batch

Array = NDArray[np.float64]
OtherEngine = Callable[[RobotModel, Commands, float], Take]
"""Plays commands for so many seconds on a robot, in an engine that shares no simulation code with this one."""
Measured = tuple[GaitMeasure, FeetMeasure]

VARIANTS: dict[str, dict[str, Any]] = {
    "2 ms": {"time_step": 2e-3}, "1 ms": {"time_step": 1e-3}, "0.5 ms": {"time_step": 5e-4},
    "sap": {"time_step": 2e-3, "approximation": "sap"}, "similar": {"time_step": 2e-3, "approximation": "similar"},
    "hydroelastic": {"time_step": 2e-3, "contact": "hydroelastic"}}
"""Ways to compute the same: steps, contact approximations of Drake, hydroelastic feet; what has no step in its name is compared
at 2 ms, which is what the floor of the steps allows for."""
LEAD = 0.3
"""At rest before the first command [s]."""


@dataclass(frozen=True)
class CertifyOptions:
    """How a gait is examined for its certificate. InputError for a number out of range or a variant that is not known.

    seconds: of walking on the nominal robot [s], six as in the thesis; draw_seconds: on each draw [s]. draws: how many robots of
    the ensemble, not those of the search. step: of the simulation [s]. checked: how many of the draws Drake simulates too, beside
    the nominal robot, which is always Drake's: for checked_seconds of walking [s] at checked_step [s], so that the same discrete
    step is compared. variants: of VARIANTS, ways to compute the same, which give the numerical floor, floor_seconds each [s].
    n_jobs: processes."""

    seconds: float = 6.0
    draw_seconds: float = 3.0
    draws: int = 64
    step: float = 1e-3
    checked: int = 8
    checked_seconds: float = 1.0
    checked_step: float = 2e-3
    floor_seconds: float = 2.0
    variants: tuple[str, ...] = tuple(VARIANTS)
    n_jobs: int = 2

    def __post_init__(self) -> None:
        check_whole(self, draws=0, checked=0, n_jobs=1)
        check_positive(self, "seconds", "draw_seconds", "step", "checked_seconds", "checked_step", "floor_seconds")
        for name in self.variants:
            check_choice("variants", name, VARIANTS)


@dataclass(frozen=True)
class Examiner:
    """One table on one robot, on the required slope. Every method is one piece of work and can be sent to another process."""

    model: RobotModel
    legs: tuple[Leg, ...]
    table: GaitTable
    options: CertifyOptions

    def nominal(self) -> tuple[Take, GaitMeasure, FeetMeasure]:
        """The nominal robot in Drake, with contact forces."""
        config = SimulationConfig(base="free", time_step=self.options.step, engine="drake")
        (take,) = simulate_batch([self._job(self.model, config, self.options.seconds, "optimised gait")])
        return take, *self._measured(take, self.model)

    def ways(self) -> tuple[Take, dict[str, Any]]:
        """In and out: a run of start, some cycles, stop, and a second at rest."""
        cycles = max(2, math.ceil(1.0 / self.table.period))
        commands = self.table.commands(cycles, whole=True)
        job = Job(self.model, SimulationConfig(base="free", time_step=self.options.step), commands, commands.end + 1.0, LEAD,
                  name="in and out")
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

    def robots(self, robots: Sequence[RobotModel]) -> list[Measured | None]:
        """Robots of the ensemble, by the compiled station; None for one that lay on the floor or tripped over itself."""
        config = SimulationConfig(base="free", time_step=self.options.step, contact_period=0.0, log_period=0.01)
        takes = Rollouts(1).takes([self._job(r, config, self.options.draw_seconds) for r in robots])
        return [None if take is None else self._measured(take, robot) for take, robot in zip(takes, robots)]

    def checked(self, robot: RobotModel) -> tuple[GaitMeasure, GaitMeasure]:
        """One of them by the compiled station and by Drake, at the same step."""
        o = self.options
        config = SimulationConfig(base="free", time_step=o.checked_step, contact_period=0.0, log_period=0.01, settle=LEAD)
        (take,) = Rollouts(1).takes([self._job(robot, config, o.checked_seconds)])
        (again,) = simulate_batch([self._job(robot, replace(config, engine="drake"), o.checked_seconds)])
        ours = fallen(len(self.model.joints)) if take is None else self._measured(take, robot)[0]
        return ours, self._measured(again, robot)[0]

    def variant(self, name: str) -> GaitMeasure:
        """The nominal robot, computed in another way: one of VARIANTS."""
        config = replace(SimulationConfig(base="free", contact_period=0.0, log_period=0.01), **VARIANTS[name])
        (take,) = simulate_batch([self._job(self.model, config, self.options.floor_seconds)])
        return self._measured(take, self.model)[0]

    def elsewhere(self, engine: OtherEngine) -> Measured:
        """The nominal robot in another engine."""
        commands, end = self._commands(self.options.seconds)
        return self._measured(engine(self.model, commands, end), self.model)

    def _measured(self, take: Take, model: RobotModel) -> Measured:
        period = self.table.period
        begin = self.table.start_seconds + period  # as in the search, the heading settles in the first whole cycle
        feet = feet_measure(take, model, self.legs, begin, period)
        return replace(measure(take, model, begin, period), clearance=feet.clearance), feet

    def _commands(self, seconds: float) -> tuple[Commands, float]:
        cycles = 1 + max(2, math.ceil(seconds / self.table.period))
        return self.table.commands(cycles), self.table.start_seconds + cycles * self.table.period

    def _job(self, model: RobotModel, config: SimulationConfig, seconds: float, name: str = "gait") -> Job:
        commands, end = self._commands(seconds)
        return Job(model, config, commands, end, LEAD, name=name)


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
