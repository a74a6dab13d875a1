"""Steering once a cycle: a model-predictive controller as a Drake system, and a proportional law to compare it with.

Both run once a cycle. At the end of cycle k, cycle k+1 is already on the controller (an upload takes 0.2 s); they choose what
cycle k+2 is steered by. Both estimate the robot's own turning bias, gain and stride (`observer`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus, LeafSystem

from workbench.gait.drive import observer as at
from workbench.gait.drive.family import Steer
from workbench.gait.drive.observer import first_state, update_state
from workbench.gait.drive.options import DriveOptions
from workbench.gait.drive.path import WayPath
from workbench.gait.drive.plan import Disc, Planned, corridor, of_robot, plan
from workbench.gait.drive.step_map import StepMap
from workbench.types import Array


class CycleController(LeafSystem):
    """Ports: `pose` in, x, y [m] and heading [rad] at the end of a cycle, NaN where the cameras lost the robot; `turn` out, of
    the cycle after next [rad per stance]; `state` out, the estimate: x, y, heading, and the robot's turning bias beyond the map's
    [rad per cycle]; `side` out, the sideways stride of that cycle [m per stance]; `along` out, distance along the path [m];
    `stop` out, 1 where the path ends with the next cycle, which is committed, or the robot was lost; `lost` out, 1 where it was
    lost.

    Updates every `period` [s], from `period` on. discs: obstacles, which only the law "mpc" avoids.
    """

    def __init__(self, path: WayPath, step_map: StepMap, period: float, options: DriveOptions | None = None,
                 discs: Sequence[Disc] = ()) -> None:
        super().__init__()
        self.path, self.map, self.period, self.discs = path, step_map, period, tuple(discs)
        self.options = options or DriveOptions()
        self._pose = self.DeclareVectorInputPort("pose", 3)
        self.DeclareDiscreteState(first_state(step_map, self.options))
        self.DeclareVectorOutputPort("turn", 1, self._say(lambda x: x[at.AFTER:at.AFTER + 1]))
        self.DeclareVectorOutputPort("side", 1, self._say(lambda x: x[at.AFTER_SIDE:at.AFTER_SIDE + 1]))
        self.DeclareVectorOutputPort("state", 4, self._say(lambda x: x[at.X:at.BIAS + 1]))
        self.DeclareVectorOutputPort("along", 1, self._say(lambda x: x[at.ALONG:at.ALONG + 1]))
        self.DeclareVectorOutputPort("stop", 1, self._say(lambda x: np.array([float(self._ends(x))])))
        self.DeclareVectorOutputPort("lost", 1, self._say(lambda x: np.array([float(self._is_lost(x))])))
        self.DeclarePeriodicDiscreteUpdateEvent(period, period, self._update)

    def _say(self, of: Callable[[Array], Array]) -> Callable[[Context, BasicVector], None]:
        def calculate(context: Context, out: BasicVector) -> None:
            out.SetFromVector(of(context.get_discrete_state(0).value()))
        return calculate

    def _is_lost(self, x: Array) -> bool:
        return bool(x[at.LOST] * self.period >= self.options.blind - 1e-9)

    def _ends(self, x: Array) -> bool:
        return bool(self._is_lost(x) or x[at.ALONG] + 1.5 * x[at.AHEAD] >= self.path.length)

    def _update(self, context: Context, values: DiscreteValues) -> EventStatus:
        x = np.array(context.get_discrete_state(0).value())
        x[at.PLAYED], x[at.NEXT], before = x[at.NEXT], x[at.AFTER], x[at.PLAYED]
        x[at.PLAYED_SIDE], x[at.NEXT_SIDE] = x[at.NEXT_SIDE], x[at.AFTER_SIDE]
        x = update_state(x, np.asarray(self._pose.Eval(context)), before, self.map, self.options)
        x[at.ALONG], left = self.path.project(x[[at.X, at.Y]], x[at.ALONG])
        decided = self._decide(x, left)
        x[at.AFTER], x[at.AFTER_SIDE] = decided.turn, decided.side
        values.set_value(0, x)
        return EventStatus.Succeeded()

    def _decide(self, x: Array, left: float) -> Steer:
        """For the cycle after next, from the state at the end of this one: first through the cycle that is committed."""
        m, o = self._own(x), self.options
        along, left, heading = self._predict_committed(x, left, m)
        if o.law == "proportional":
            side = limit_steer(Steer(0.0, -m.aside / m.side_gain if m.side_gain else 0.0), _next(x), o).side
            off = heading - self.path.heading(along) + np.arctan(left / o.reach) + (m.aside + m.side_gain * side) / m.ahead
            bend = self.path.heading(along + m.ahead) - self.path.heading(along)
            wanted = bend - (m.bias + x[at.BIAS] + m.side_turns * side) - off * m.ahead / o.reach
            return limit_steer(Steer(wanted / (m.gain + m.memory), side), _next(x), o)
        planned = self._plan(along, left, heading, x, m)
        return limit_steer(Steer(planned.turns[0], planned.sides[0]), _next(x), o)

    def _own(self, x: Array) -> StepMap:
        """The map of this robot, as it is estimated."""
        return of_robot(self.map, x[at.AHEAD], x[at.ASIDE], x[at.GAIN])

    def _predict_committed(self, x: Array, left: float, m: StepMap) -> tuple[float, float, float]:
        """Distance along the path, lateral error [m] and heading [rad] after the cycle that is on the controller already."""
        off = x[at.HEADING] - self.path.heading(x[at.ALONG])
        along = x[at.ALONG] + m.ahead
        bend = self.path.heading(along) - self.path.heading(x[at.ALONG])
        left = left + m.ahead * np.sin(off - bend / 2) + m.aside + m.moved_aside(_next(x))
        return along, left, x[at.HEADING] + m.turned(_next(x), x[at.PLAYED]) + x[at.BIAS]

    def _plan(self, along: float, left: float, heading: float, x: Array, m: StepMap) -> Planned:
        ahead = np.asarray(along + m.ahead * np.arange(self.options.horizon + 1), float)
        targets = np.array([self.path.heading(s) for s in ahead])
        bounds = corridor(self.path, ahead, left, self.discs, self.options.clearance) if self.discs else None
        return plan(left, heading, _next(x), x[at.BIAS], targets, m, self.options, bounds)

    def planned_points(self, context: Context) -> Array:
        """Planned positions from the present state: (N + 1, 2) [m] from the cycle after next on."""
        x = np.array(context.get_discrete_state(0).value())
        m = self._own(x)
        _, left = self.path.project(x[[at.X, at.Y]], x[at.ALONG])
        along, left, heading = self._predict_committed(x, left, m)
        planned = self._plan(along, left, heading, x, m)
        return np.array([self.path.point(along + m.ahead * j, y) for j, y in enumerate(planned.left)])


def _next(x: Array) -> Steer:
    """Steering of the cycle that is on the controller already."""
    return Steer(x[at.NEXT], x[at.NEXT_SIDE])


def limit_steer(steer: Steer, before: Steer, o: DriveOptions) -> Steer:
    """Turn and sideways stride clipped to the largest that a table has, and to the largest change between consecutive tables."""
    return Steer(_clip(steer.turn, before.turn, o.most, o.most_change),
                 _clip(steer.side, before.side, o.most_side, o.most_side_change))


def _clip(value: float, before: float, most: float, change: float) -> float:
    return float(np.clip(np.clip(value, before - change, before + change), -most, most))
