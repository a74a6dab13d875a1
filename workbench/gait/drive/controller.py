"""What the cycle after next plays: a model-predictive controller as a Drake system, and the simplest thing that could work.

Both run once a cycle. At the end of cycle k, cycle k+1 is already on the controller (an upload takes 83 ms); they choose the turn
of cycle k+2. Both estimate the robot's own turning bias by a Kalman filter on the step-to-step map.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from workbench.files.option_checks import check_choice, check_positive, check_whole
from workbench.gait.drive.path import WayPath
from workbench.gait.drive.step_map import StepMap
from workbench.types import Array

Law = Literal["mpc", "proportional"]


@dataclass(frozen=True)
class DriveOptions:
    """How the controller weighs and limits.

    law: "mpc", or "proportional" with the same observer. horizon: cycles looked ahead; eight are about a metre. most: largest
    turn [rad per stance]. most_change: from one cycle to the next [rad]; beyond it the feet of two tables no longer meet. aside,
    turned: errors that weigh the same [m], [rad]: 3 cm and 6 deg. change: change of turn that weighs as much [rad]. reach:
    distance over which the proportional law removes a lateral error [m]; below 0.5 m the two cycles of delay make it oscillate.
    drift: how fast the robot's own bias may change [rad per cycle], with voltage and floor. first_bias: standard deviation of the
    bias before the first observation [rad per cycle]. noise: of a captured heading [rad]. lost: cycles without a pose after which
    the robot stops.
    """

    law: Law = "mpc"
    horizon: int = 8
    most: float = 0.15
    most_change: float = 0.08
    aside: float = 0.03
    turned: float = 0.1
    change: float = 0.1
    reach: float = 0.6
    drift: float = 0.002
    first_bias: float = 0.05
    noise: float = 0.0021
    lost: int = 4

    def __post_init__(self) -> None:
        check_choice("law", self.law, ("mpc", "proportional"))
        check_whole(self, horizon=2, lost=1)
        check_positive(self, "most", "most_change", "aside", "turned", "change", "reach", "drift", "first_bias", "noise")


_X, _Y, _HEADING, _BIAS, _P00, _P01, _P11, _PLAYED, _NEXT, _AFTER, _ALONG, _LOST, _STARTED = range(13)


class CycleController(LeafSystem):
    """Ports: `pose` in, x, y [m] and heading [rad] at the end of a cycle, NaN where the cameras lost the robot; `turn` out, of
    the cycle after next [rad per stance]; `state` out, the estimate: x, y, heading, and the robot's turning bias beyond the map's
    [rad per cycle]; `along` out, distance along the path [m]; `stop` out, 1 where the path ends or the robot was lost.

    Updates every `period` [s], from `period` on.
    """

    def __init__(self, path: WayPath, step_map: StepMap, period: float, options: DriveOptions | None = None) -> None:
        super().__init__()
        self.path, self.map, self.options = path, step_map, options or DriveOptions()
        self._pose = self.DeclareVectorInputPort("pose", 3)
        start = np.zeros(13)
        start[_P11] = self.options.first_bias**2
        self.DeclareDiscreteState(start)
        self.DeclareVectorOutputPort("turn", 1, self._say(lambda x: x[_AFTER:_AFTER + 1]))
        self.DeclareVectorOutputPort("state", 4, self._say(lambda x: x[_X:_BIAS + 1]))
        self.DeclareVectorOutputPort("along", 1, self._say(lambda x: x[_ALONG:_ALONG + 1]))
        self.DeclareVectorOutputPort("stop", 1, self._say(lambda x: np.array([float(self._ends(x))])))
        self.DeclarePeriodicDiscreteUpdateEvent(period, period, self._update)

    def _say(self, of: Callable[[Array], Array]) -> Callable[[Context, BasicVector], None]:
        def calculate(context: Context, out: BasicVector) -> None:
            out.SetFromVector(of(context.get_discrete_state(0).value()))
        return calculate

    def _ends(self, x: Array) -> bool:
        return bool(x[_LOST] >= self.options.lost or x[_ALONG] + self.map.ahead / 2 >= self.path.length)

    def _update(self, context: Context, values: DiscreteValues) -> EventStatus:
        x = np.array(context.get_discrete_state(0).value())
        x[_PLAYED], x[_NEXT], before = x[_NEXT], x[_AFTER], x[_PLAYED]
        x = observed(x, np.asarray(self._pose.Eval(context)), before, self.map, self.options)
        x[_ALONG], left = self.path.project(x[[_X, _Y]], x[_ALONG])
        x[_AFTER] = self._decide(x, left)
        values.set_value(0, x)
        return EventStatus.Succeeded()

    def _decide(self, x: Array, left: float) -> float:
        """The turn of the cycle after next, from the state at the end of this one: first through the cycle that is committed."""
        m, o = self.map, self.options
        off = x[_HEADING] - self.path.heading(x[_ALONG])
        along = x[_ALONG] + m.ahead
        left = left + m.ahead * np.sin(off) + m.aside
        heading = x[_HEADING] + m.turned(x[_NEXT], x[_PLAYED]) + x[_BIAS]
        if o.law == "proportional":
            wanted = -(m.bias + x[_BIAS]) - (heading - self.path.heading(along) + np.arctan(left / o.reach)) * m.ahead / o.reach
            return limited(wanted / (m.gain + m.memory), x[_NEXT], o)
        ahead = along + m.ahead * np.arange(o.horizon + 1)
        targets = np.array([self.path.heading(s) for s in ahead])
        return limited(plan(left, heading, x[_NEXT], x[_BIAS], targets, m, o)[0], x[_NEXT], o)


def limited(turn: float, before: float, options: DriveOptions) -> float:
    """Within what a table turns, and what two tables that follow each other may differ by [rad]."""
    return float(np.clip(np.clip(turn, before - options.most_change, before + options.most_change), -options.most, options.most))


def observed(x: Array, pose: Array, before: float, m: StepMap, options: DriveOptions) -> Array:
    """The state after one more cycle: predicted by the map, corrected by the pose, if there is one.

    x: state of `CycleController` whose played turn is already that of this cycle; before: turn of the one before [rad].
    """
    x = x.copy()
    off = x[_HEADING]
    x[_X] += m.ahead * np.cos(off) - m.aside * np.sin(off)
    x[_Y] += m.ahead * np.sin(off) + m.aside * np.cos(off)
    x[_HEADING] += m.turned(x[_PLAYED], before) + x[_BIAS]
    P = np.array([[x[_P00], x[_P01]], [x[_P01], x[_P11]]])
    F = np.array([[1.0, 1.0], [0.0, 1.0]])
    P = F @ P @ F.T + np.diag([m.scatter[0]**2, options.drift**2])
    if np.isfinite(pose).all():
        first = not x[_STARTED]
        x[_X], x[_Y] = pose[:2]
        wrong = np.arctan2(np.sin(pose[2] - x[_HEADING]), np.cos(pose[2] - x[_HEADING]))
        if first:  # the start of the gait turns the robot too: its first heading says nothing of the bias
            x[_HEADING] += wrong
            P = np.diag([options.noise**2, options.first_bias**2])
        else:
            K = P[:, 0] / (P[0, 0] + options.noise**2)
            x[_HEADING] += K[0] * wrong
            x[_BIAS] += K[1] * wrong
            P = P - np.outer(K, P[0])
        x[_LOST], x[_STARTED] = 0.0, 1.0
    else:
        x[_LOST] += 1
    x[_P00], x[_P01], x[_P11] = P[0, 0], P[0, 1], P[1, 1]
    return x


def plan(left: float, heading: float, before: float, bias: float, targets: Array, m: StepMap, o: DriveOptions) -> Array:
    """Turns (N,) [rad] of the next N cycles: a quadratic programme, solved by Clarabel.

    left: lateral error [m], heading [rad] where the first of them begins; before: turn of the cycle before it; targets (N + 1,):
    heading of the path at each cycle's beginning and after the last [rad]. In errors e = heading - target:

        left(j+1) = left(j) + ahead · e(j) + aside
        e(j+1) = e(j) + bias + gain u(j) + memory u(j-1) - (target(j+1) - target(j))
        minimise sum (left/aside weight)² + (e/turned weight)² + (change of u/change weight)², limits on u and its change
    """
    N = len(targets) - 1
    program = MathematicalProgram()
    u, y, e = (program.NewContinuousVariables(n, name) for n, name in ((N, "turn"), (N + 1, "left"), (N + 1, "heading error")))
    first = np.arctan2(np.sin(heading - targets[0]), np.cos(heading - targets[0]))
    program.AddBoundingBoxConstraint([left, first], [left, first], [y[0], e[0]])
    own, turning = m.bias + bias, np.diff(targets)
    I = np.eye(N)
    before_u = np.eye(N, k=-1)
    moved = np.hstack([np.diff(np.eye(N + 1), axis=0), -m.ahead * np.eye(N, N + 1)])
    program.AddLinearEqualityConstraint(moved, np.full(N, m.aside), np.concatenate([y, e]))
    turned = np.hstack([np.diff(np.eye(N + 1), axis=0), -m.gain * I - m.memory * before_u])
    right = own - turning
    right[0] += m.memory * before
    program.AddLinearEqualityConstraint(turned, right, np.concatenate([e, u]))
    program.AddBoundingBoxConstraint(-o.most, o.most, u)
    D = I - before_u
    start = np.zeros(N)
    start[0] = before
    program.AddLinearConstraint(D, start - o.most_change, start + o.most_change, u)
    program.AddQuadraticErrorCost(np.eye(N + 1) / o.aside**2, np.zeros(N + 1), y)
    program.AddQuadraticErrorCost(np.eye(N + 1) / o.turned**2, np.zeros(N + 1), e)
    program.Add2NormSquaredCost(D / o.change, start / o.change, u)
    result = ClarabelSolver().Solve(program)
    if not result.is_success():  # the limits on u alone are always met together
        raise RuntimeError(f"the quadratic programme of {N} cycles was not solved: {result.get_solution_result()}")
    return np.asarray(result.GetSolution(u))
