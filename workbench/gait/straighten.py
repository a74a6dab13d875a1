"""A gait straightened for one robot: its response to `turn`, and its residual heading after one metre and after three."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.gait.evaluate import SEARCH, Evaluator
from workbench.gait.limits import Margin, table_margins, violation
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure
from workbench.gait.request import Request
from workbench.gait.requirements import SLOWEST, drift, excess_turning
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table
from workbench.gait.turning import GAIN_SPREAD, LEAST_SD, TurnEstimate, rms
from workbench.robot import RobotModel

PROBE = 0.02
"""Change of `turn` [rad] to either side, from whose effect on the nominal robot the gain is computed."""
PROBED = 8
"""Robots of the ensemble on which the response to `turn` is measured, in addition to the nominal one."""
FEWEST_ROBOTS = 4
"""Of those, from which the response of others is estimated."""
LEAST_GAIN_SPREAD = 0.1
"""Standard deviation of a robot's response, as a share, that is assumed at least."""
METRES = 3
"""How many are recorded, one after the other, each with the motion that the one before led to."""
LONGEST = 8.0
"""Of one of those walks [s]; slow gaits do not come a metre far."""
SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Of a change of `turn` that are tried until the table keeps its own limits."""


@dataclass(frozen=True)
class TurnResponse:
    """Effect of a change of `turn` on the rate of turning. rate: of the nominal robot [1/s]; speed: its speed [m/s]; share:
    mean of other robots' rates, by the nominal one's; sd: standard deviation of a robot's rate, as a share of that mean."""

    rate: float
    speed: float
    share: float = 1.0
    sd: float = GAIN_SPREAD

    @property
    def nominal_gain(self) -> float:
        """Heading by distance that a change of `turn` gives the nominal robot [1/m]."""
        return self.rate / max(abs(self.speed), SLOWEST)

    def gain(self, speed: float) -> float:
        """Expected heading by distance for a change of `turn` [1/m] of a robot that walks at a speed [m/s]: a slow one takes more
        cycles for a metre, and turns in each."""
        return self.share * self.rate / max(abs(speed), SLOWEST)


def turn_response(machine: GaitMachine, request: Request, shape: GaitShape, robots: Sequence[RobotModel] = ()
                  ) -> TurnResponse:
    """Measured in two rollouts of the nominal robot, and of each of `robots`, which the ensemble has drawn: with fewer than
    FEWEST_ROBOTS of them, other robots are assumed to respond as the nominal one. InputError for a turn in place, for a gait that
    falls, and for one on which `turn` has no effect in the expected direction."""
    if request.way == "turn":
        raise InputError(None, "a turn in place has no heading to straighten; expected a gait that goes somewhere")
    evaluator = Evaluator(machine, request, (), n_jobs=1, config=SEARCH)
    turned = [replace(shape, turn=shape.turn + change) for change in (-PROBE, PROBE)]
    right, left = evaluator.measure([(s, evaluator.nominal) for s in turned])
    rate = (excess_turning(request, left) - excess_turning(request, right)) / (2 * PROBE)
    if right.fell or left.fell or rate <= 0:
        raise InputError(None, f"the gait does not answer to its turn ({rate:.2g} 1/s); expected one that can be steered")
    speed = (request.progress(left) + request.progress(right)) / 2
    others = evaluator.measure([(s, robot) for robot in robots for s in turned])
    pairs = [(a, b) for a, b in zip(others[::2], others[1::2]) if not (a.fell or b.fell)]
    shares = [(excess_turning(request, b) - excess_turning(request, a)) / (2 * PROBE * rate) for a, b in pairs]
    if len(shares) < FEWEST_ROBOTS or not 0.2 < float(np.mean(shares)) < 5.0:
        return TurnResponse(rate, speed)
    mean = float(np.mean(shares))
    return TurnResponse(rate, speed, mean, max(float(np.std(shares, ddof=1)) / mean, LEAST_GAIN_SPREAD))


def turned_by(machine: GaitMachine, request: Request, shape: GaitShape, change: float) -> GaitShape:
    """The shape with another `turn` [rad], by as much of the change as its table's own limits allow."""
    for share in SHARES:
        turned = replace(shape, turn=shape.turn + share * change)
        try:
            if not violation(table_margins(machine, gait_table(machine, turned), request.limits)):
                return turned
        except InputError:
            continue
    return shape


def spread_of(m: GaitMeasure, request: Request, period: float) -> float:
    """Standard deviation of a run's heading by distance [rad/m], by its scatter from cycle to cycle. period: of a cycle [s]."""
    if not math.isfinite(m.scatter[1]):
        return LEAST_SD
    cycles = m.gone / max(abs(request.progress(m)) * period, 1e-3)
    return max(m.scatter[1] * math.sqrt(max(cycles, 1.0)) / max(m.gone, 0.01), LEAST_SD)


@dataclass(frozen=True)
class Straightener:
    """Robots that record a metre, are straightened, and record the next. response: to a change of `turn`; spread: of headings
    over the ensemble [rad/m]. step: of the simulation [s]. Can be sent to a process."""

    model: RobotModel
    request: Request
    shape: GaitShape
    response: TurnResponse
    spread: float
    step: float = SEARCH.time_step

    def robots(self, robots: Sequence[RobotModel]) -> list[tuple[float, ...]]:
        """Heading by distance [rad/m] of each robot: untrimmed, and after each recorded metre; shorter where it fell."""
        machine = GaitMachine(self.model)
        seconds = min(1.0 / max(abs(self.response.speed), SLOWEST), LONGEST)
        evaluator = Evaluator(machine, self.request, (), n_jobs=1, config=replace(SEARCH, time_step=self.step), seconds=seconds)
        return [self._one(machine, evaluator, robot) for robot in robots]

    def _one(self, machine: GaitMachine, evaluator: Evaluator, robot: RobotModel) -> tuple[float, ...]:
        estimate: TurnEstimate | None = None
        shape, out = self.shape, list[float]()
        for metre in range(METRES + 1):
            (m,) = evaluator.measure([(shape, robot)])
            if m.fell:
                break
            if estimate is None:
                gain = self.response.gain(self.request.progress(m))
                estimate = TurnEstimate.before(self.spread, gain, self.response.sd)
            out.append(drift(self.request, m))
            if metre < METRES:
                estimate = estimate.after(shape.turn - self.shape.turn, out[-1], spread_of(m, self.request, shape.period))
                shape = turned_by(machine, self.request, self.shape, estimate.turn)
        return tuple(out)


def trim_margin(request: Request, walks: Sequence[tuple[float, ...]]) -> Margin:
    """Limit on the residual heading after METRES recorded metres. walks: as `Straightener.robots` returns them; none where the
    gait does not respond to its turn."""
    name, allowed = f"drift after {METRES} recorded metres", math.degrees(request.limits.trimmed)
    left = [math.degrees(w[METRES]) for w in walks if len(w) > METRES]
    if not left:
        return Margin(name, "robot", math.inf, allowed, "deg/m RMS, cannot be steered", 2.0)
    return Margin(name, f"{len(left)} robots", rms(left), allowed, "deg/m RMS", rms(left) / allowed)


def summary_of_straightened(walks: Sequence[tuple[float, ...]], gain: float) -> dict[str, Any]:
    """The certificate's entry for straightened robots. walks: as `Straightener.robots` gives them [rad/m]."""
    every = {n: [math.degrees(w[n]) for w in walks if len(w) > n] for n in (0, 1, METRES)}
    return {"robots": len(walks), "fell while they were straightened": sum(len(w) <= METRES for w in walks),
            "gain 1/m": gain, "untrimmed deg/m RMS": rms(every[0]), "after one metre deg/m RMS": rms(every[1]),
            f"after {METRES} metres deg/m RMS": rms(every[METRES])}
