"""The turns of the next cycles: a quadratic programme on Drake's `MathematicalProgram`, solved by Clarabel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from workbench.gait.drive.options import DriveOptions
from workbench.gait.drive.path import WayPath
from workbench.gait.drive.step_map import StepMap
from workbench.types import Array


@dataclass(frozen=True)
class Disc:
    """An obstacle on the floor: its centre x, y and its radius [m], in the path's frame of reference."""

    x: float
    y: float
    radius: float


@dataclass(frozen=True, eq=False)
class Planned:
    """turns (N,) [rad per stance] of the next N cycles; left (N + 1,) [m] from the path and heading error off (N + 1,) [rad] at
    each cycle's beginning and after the last."""

    turns: Array
    left: Array
    off: Array


def corridor(path: WayPath, along: Array, left: float, discs: Sequence[Disc], clearance: float) -> tuple[Array, Array]:
    """Lowest and highest lateral position (N,) [m] at distances `along` (N,) [m] of the path that keep clear of the discs,
    infinite where there is none. A disc is passed on the side on which its centre is farther from the path, or on which the robot
    (at `left` [m]) already walks past it."""
    low, high = np.full(len(along), -np.inf), np.full(len(along), np.inf)
    for disc in discs:
        where, aside = path.project(np.array([disc.x, disc.y]), 0.0, window=np.inf)
        reach = disc.radius + clearance
        near = np.abs(along - where) < reach
        half = np.sqrt(np.maximum(reach**2 - (along - where)**2, 0.0))
        beside = near[0] and abs(left - aside) > half[0] / 2
        if (left > aside) if beside else (aside <= 0.0):
            low[near] = np.maximum(low[near], (aside + half)[near])
        else:
            high[near] = np.minimum(high[near], (aside - half)[near])
    return low, high


def plan(left: float, heading: float, before: float, bias: float, targets: Array, m: StepMap, o: DriveOptions,
         bounds: tuple[Array, Array] | None = None) -> Planned:
    """The turns of the next N cycles.

    left: lateral error [m], heading [rad] where the first of them begins; before: turn of the cycle before it [rad]; bias: of the
    robot beyond the map's [rad per cycle]; targets (N + 1,): heading of the path at each cycle's beginning and after the last
    [rad]; bounds: of the lateral position (N + 1,) each [m]. In errors e = heading - target:

        left(j+1) = left(j) + ahead · (e(j) - bend(j)/2) + aside + aside_gain · u(j),  bend(j) = target(j+1) - target(j)
        e(j+1) = e(j) + bias + gain u(j) + memory u(j-1) - bend(j)
        minimise sum (left/aside weight)² + (e/turned weight)² + (change of u/change weight)² + inside · (way out of bounds)
        within limits on u and its change

    On an arc that the robot follows exactly, the path moves aside by ahead · bend/2 in each cycle, as the robot does.
    """
    N = len(targets) - 1
    program = MathematicalProgram()
    u, y, e = (program.NewContinuousVariables(n, name) for n, name in ((N, "turn"), (N + 1, "left"), (N + 1, "heading error")))
    first = np.arctan2(np.sin(heading - targets[0]), np.cos(heading - targets[0]))
    program.AddBoundingBoxConstraint([left, first], [left, first], [y[0], e[0]])
    own, turning = m.bias + bias, np.diff(targets)
    I, before_u, steps = np.eye(N), np.eye(N, k=-1), np.diff(np.eye(N + 1), axis=0)
    moved = np.hstack([steps, -m.ahead * np.eye(N, N + 1), -m.aside_gain * I])
    program.AddLinearEqualityConstraint(moved, m.aside - m.ahead * turning / 2, np.concatenate([y, e, u]))
    turned = np.hstack([steps, -m.gain * I - m.memory * before_u])
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
    if bounds is not None:
        _add_bounds(program, y, bounds, o)
    result = ClarabelSolver().Solve(program)
    if not result.is_success():  # the limits on u alone are always met together
        raise RuntimeError(f"the quadratic programme of {N} cycles was not solved: {result.get_solution_result()}")
    return Planned(*(np.asarray(result.GetSolution(v)) for v in (u, y, e)))


def _add_bounds(program: MathematicalProgram, y: Array, bounds: tuple[Array, Array], o: DriveOptions) -> None:
    """Bounds on the lateral positions, which may be broken at a price: a robot inside one must still be given a way out."""
    low, high = bounds
    limited = np.flatnonzero(np.isfinite(low) | np.isfinite(high))
    if not len(limited):
        return
    over = program.NewContinuousVariables(len(limited), "inside")
    program.AddBoundingBoxConstraint(0.0, np.inf, over)
    program.AddLinearCost(np.full(len(limited), o.inside / o.aside), 0.0, over)
    pick = np.eye(len(y))[limited]
    program.AddLinearConstraint(np.hstack([pick, np.eye(len(limited))]), low[limited], np.full(len(limited), np.inf),
                                np.concatenate([y, over]))
    program.AddLinearConstraint(np.hstack([pick, -np.eye(len(limited))]), np.full(len(limited), -np.inf), high[limited],
                                np.concatenate([y, over]))


def of_robot(m: StepMap, ahead: float, aside: float, gain: float) -> StepMap:
    """The map of a robot that goes so far ahead and aside in a cycle [m], and whose response to a turn exceeds the map's by the
    share `gain`."""
    share = 1.0 + gain
    return replace(m, ahead=ahead, aside=aside, gain=share * m.gain, memory=share * m.memory, aside_gain=share * m.aside_gain)
