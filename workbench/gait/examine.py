"""The runs that a certificate is made of, each for itself, so that all cores share them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import minimum_filter1d

from workbench.files import InputError
from workbench.files.option_checks import check_choice, check_positive, check_whole
from workbench.gait.draws import Drawn, record_draw
from workbench.gait.feet import FeetMeasure, feet_measure
from workbench.gait.legs import Leg
from workbench.gait.limit_cycle import LimitCycle, limit_cycle
from workbench.gait.measure import ROWS, GaitMeasure, base_jerk, fallen, measure
from workbench.gait.record import Rest, Stretch, Ways
from workbench.gait.rollouts import Rollouts
from workbench.gait.second_engine import Condition, Pair
from workbench.gait.self_contact import Nearness, SelfContact
from workbench.gait.table import GaitTable
from workbench.motion import Commands, PoseTable, load_motion
from workbench.recording.take import Take
from workbench.robot import RobotModel, data_file
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.types import Array, Mask

OtherEngine = Callable[[RobotModel, Commands, float], Take]
"""Plays commands for so many seconds on a robot, in an engine that shares no simulation code with this one."""
Measured = tuple[GaitMeasure, FeetMeasure]

VARIANTS: dict[str, dict[str, Any]] = {
    "2 ms": {"time_step": 2e-3}, "1 ms": {"time_step": 1e-3}, "0.5 ms": {"time_step": 5e-4},
    "sap": {"time_step": 2e-3, "approximation": "sap"}, "similar": {"time_step": 2e-3, "approximation": "similar"},
    "hydroelastic": {"time_step": 2e-3, "contact": "hydroelastic"}}
"""Numerical variants: steps, contact approximations of Drake, hydroelastic feet; a variant without a step in its name is compared
at 2 ms, which the floor of the steps allows."""
LEAD = 0.3
"""At rest before the first command [s]."""
REST, SHORT_REST = 1.0, 0.3
"""At rest after the last one [s]: of the nominal robot, and of others, which have only to stay on their feet."""
SELF_CONTACT_EVERY = 0.02
"""How often links are looked at for contact with each other [s]: a joint at no-load speed turns by 6 deg meanwhile, and feet pass
each other no faster."""


@dataclass(frozen=True)
class CertifyOptions:
    """How a gait is examined for its certificate. InputError for a number out of range or a variant that is not known.

    seconds: of walking on the nominal robot [s], six as in the thesis; draw_seconds: on each draw [s]. draws: how many robots
    of the ensemble, not those of the search. step: of the simulation [s]. checked: how many of the draws Drake simulates too,
    in addition to the nominal robot, which is always Drake's: for checked_seconds of walking [s] at checked_step [s], so that the
    same discrete step is compared. compared_seconds: of walking in each condition in which another engine plays the table too
    [s]; compared: allowed difference there, as a share of the nominal speed: contact models differ by a tenth where feet
    slide. variants: of VARIANTS, which give the numerical floor, floor_seconds each [s]. watched:
    cycles of each run in which the return of the gait to its cycle is examined; 0: it is not. trimmed: how many of the draws are
    straightened by their own recordings, metre by metre; 0: none. n_jobs: processes."""

    seconds: float = 6.0
    draw_seconds: float = 3.0
    draws: int = 64
    step: float = 1e-3
    checked: int = 8
    checked_seconds: float = 1.0
    checked_step: float = 2e-3
    compared_seconds: float = 2.0
    compared: float = 0.15
    floor_seconds: float = 2.0
    watched: int = 12
    trimmed: int = 24
    variants: tuple[str, ...] = tuple(VARIANTS)
    n_jobs: int = 2

    def __post_init__(self) -> None:
        check_whole(self, draws=0, checked=0, watched=0, trimmed=0, n_jobs=1)
        check_positive(self, "seconds", "draw_seconds", "step", "checked_seconds", "checked_step", "floor_seconds",
                       "compared_seconds", "compared")
        for name in self.variants:
            check_choice("variants", name, VARIANTS)


@dataclass(frozen=True)
class NominalRun:
    """The nominal robot from power-on to standstill. ways: of start, gait, stop and the rest after it, a few numbers each. near:
    where links came closest. cycles: how often the loop was played."""

    take: Take
    measure: GaitMeasure
    feet: FeetMeasure
    ways: Ways
    near: Nearness
    cycles: int


@dataclass(frozen=True)
class Examiner:
    """One table on one robot, on the required slope. Every method is one piece of work and can be sent to another process."""

    model: RobotModel
    legs: tuple[Leg, ...]
    table: GaitTable
    options: CertifyOptions

    def nominal(self) -> NominalRun:
        """The nominal robot in Drake, with contact forces, from power-on to a second after the stop."""
        config = SimulationConfig(base="free", time_step=self.options.step, engine="drake")
        seconds = self.options.seconds
        (take,) = simulate_batch([self._job(self.model, config, seconds, REST, "optimised gait")])
        rows = np.flatnonzero(take.time >= 0)[::max(1, round(SELF_CONTACT_EVERY / float(np.median(np.diff(take.time)))))]
        order = [take.joints.index(j) for j in self.model.joints]
        near = SelfContact(self.model).nearest(take.q[rows][:, order])
        return NominalRun(take, *self._measure(take, self.model, seconds), self._ways(take), near, self.cycles(seconds))

    def limit_cycle(self, other: PoseTable | None) -> LimitCycle:
        """The nominal robot again, entered and disturbed in other ways. other: another table, from which it comes."""
        return limit_cycle(self.model, self.table, self.options.watched, self.options.step, other)

    def cycles(self, seconds: float) -> int:
        """How many are played to walk for so long [s], after the first."""
        return 1 + max(2, math.ceil(seconds / self.table.period))

    def _ways(self, take: Take) -> Ways:
        """Parts of a whole run: start, gait, stop, and the rest after it."""
        assert take.p_WB is not None
        begin, end = self.table.start_seconds, self._walked_until(self.options.seconds)
        over = end + float(self.table.stop.dwells_ms.sum()) / 1000
        inside = ((take.time >= 0) & (take.time < begin), (take.time >= begin) & (take.time < end), take.time >= end)
        start, gait, stop = (
            Stretch(float(np.ptp(take.time[part])), _lasting(take, part), float(np.degrees(_tilt(take)[part].max())),
                    _jerk(take, part)) for part in inside)
        after = take.time > over + REST / 2
        rest = Rest(float(np.abs(np.gradient(take.p_WB[after], take.time[after], axis=0)).max()),
                    float(np.degrees(_tilt(take)[after].max())), float(np.degrees(np.abs(take.q[after]).max())))
        return Ways(start, gait, stop, rest, bool(max(start.jerk, stop.jerk) <= 1.5 * gait.jerk))

    def robots(self, robots: Sequence[RobotModel]) -> list[Drawn]:
        """Robots of the ensemble, by the compiled station; where that gives up, because something other than a foot touched the
        floor or two links each other, Drake says what came of it."""
        config = SimulationConfig(base="free", time_step=self.options.step, contact_period=0.0, log_period=ROWS)
        seconds = self.options.draw_seconds
        jobs, out = [self._job(r, config, seconds, SHORT_REST) for r in robots], []
        for robot, job, take in zip(robots, jobs, Rollouts(1).takes(jobs)):
            played = simulate_batch([replace(job, config=replace(config, engine="drake"))])[0] if take is None else take
            out.append(record_draw(robot, *self._measure(played, robot, seconds), gave_up=take is None))
        return out

    def compare_engines(self, robot: RobotModel) -> tuple[GaitMeasure, GaitMeasure]:
        """Measures of one robot by the compiled station and by Drake, at the same step."""
        o = self.options
        config = SimulationConfig(base="free", time_step=o.checked_step, contact_period=0.0, log_period=0.01, settle=LEAD)
        (take,) = Rollouts(1).takes([self._job(robot, config, o.checked_seconds)])
        (again,) = simulate_batch([self._job(robot, replace(config, engine="drake"), o.checked_seconds)])
        ours = fallen(len(self.model.joints)) if take is None else self._measure(take, robot, o.checked_seconds)[0]
        return ours, self._measure(again, robot, o.checked_seconds)[0]

    def variant(self, name: str) -> GaitMeasure:
        """The nominal robot, computed in another way: one of VARIANTS."""
        config = replace(SimulationConfig(base="free", contact_period=0.0, log_period=0.01), **VARIANTS[name])
        (take,) = simulate_batch([self._job(self.model, config, self.options.floor_seconds)])
        return self._measure(take, self.model, self.options.floor_seconds)[0]

    def elsewhere(self, engine: OtherEngine, condition: Condition) -> Pair:
        """The robot under a condition, by this engine and by another. A gait entered at once has as long as its start takes to
        find its cycle."""
        model, seconds = condition.of(self.model), self.options.compared_seconds
        cycles, until = self.cycles(seconds), self._walked_until(seconds)
        at_once = self.table.cycle.commands(math.ceil(until / self.table.period))
        commands = at_once if condition.at_once else self.table.commands(cycles, whole=True)
        config = SimulationConfig(base="free", time_step=self.options.step, contact_period=0.0, log_period=0.01)
        (ours,) = simulate_batch([Job(model, config, commands, until, LEAD, name="gait")])
        a, b = (self._measure(take, model, seconds)[0] for take in (ours, engine(model, commands, until)))
        return a, b

    def _measure(self, take: Take, model: RobotModel, seconds: float) -> Measured:
        """The measures of a take, as the search takes them: the heading settles in the first whole cycle; torque counts from
        power-on."""
        period, end = self.table.period, self._walked_until(seconds)
        begin = self.table.start_seconds + period
        feet = feet_measure(take, model, self.legs, begin, period, end)
        return replace(measure(take, model, begin, period, end=end, since=0.0), clearance=feet.clearance, slip=feet.slip), feet

    def _walked_until(self, seconds: float) -> float:
        """When the last cycle ends [s]."""
        return self.table.start_seconds + self.cycles(seconds) * self.table.period

    def _job(self, model: RobotModel, config: SimulationConfig, seconds: float, rest: float | None = None, name: str = "gait",
             ) -> Job:
        """The motion as every verb plays it. rest: how long after it [s]; None: only to the end of the last cycle."""
        commands = self.table.commands(self.cycles(seconds), whole=True)
        end = self._walked_until(seconds) if rest is None else commands.end + rest
        return Job(model, config, commands, end, LEAD, name=name)


def vendor_table(model: RobotModel) -> PoseTable | None:
    """The ROBOTIS walk, as another table from which a gait is entered; None for a robot that cannot play it."""
    try:
        return load_motion(data_file("robotis_walk.csv"), model).as_table()
    except InputError:
        return None


def _tilt(take: Take) -> Array:
    assert take.quat_WB is not None
    _, x, y, _ = take.quat_WB.T
    return np.asarray(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1, 1)))


def _lasting(take: Take, inside: Mask) -> float:
    """Largest joint torque that lasts 10 ms [N m]."""
    assert take.torque is not None
    every = float(np.median(np.diff(take.time)))
    return float(minimum_filter1d(np.abs(take.torque[inside]), max(1, round(0.01 / every)), axis=0).max())


def _jerk(take: Take, inside: Mask) -> float:
    assert take.p_WB is not None
    return base_jerk(take.time[inside], take.p_WB[inside])
