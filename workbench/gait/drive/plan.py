"""What the next cycles are steered by: a quadratic programme on Drake's `MathematicalProgram`, solved by Clarabel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from workbench.files import InputError
from workbench.gait.drive.family import Steer
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


def check_discs(path: WayPath, discs: Sequence[Disc]) -> None:
    """InputError where the start of a path, or a way-point, lies in a disc that it has to keep clear of."""
    for n, (x, y) in enumerate([(0.0, 0.0), *path.points.tolist()]):
        for disc in discs:
            if np.hypot(x - disc.x, y - disc.y) <= disc.radius:
                what = f"way-point {n} ({x:g}, {y:g})" if n else "the start (0, 0)"
                raise InputError(None, f"{what} lies in the disc to walk around, "
                                       f"{disc.radius:g} m about ({disc.x:g}, {disc.y:g})")


@dataclass(frozen=True, eq=False)
class Planned:
    """turns (N,) [rad per stance] and sides (N,) [m per stance] of the next N cycles; left (N + 1,) [m] from the path and heading
    error off (N + 1,) [rad] at each cycle's beginning and after the last."""

    turns: Array
    sides: Array
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


def plan(left: float, heading: float, before: Steer, bias: float, targets: Array, m: StepMap, o: DriveOptions,
         bounds: tuple[Array, Array] | None = None) -> Planned:
    """Turns and sideways strides of the next N cycles.

    left: lateral error [m], heading [rad] where the first of them begins; before: of the cycle before it; bias: of the
    robot beyond the map's [rad per cycle]; targets (N + 1,): heading of the path at each cycle's beginning and after the last
    [rad]; bounds: of the lateral position (N + 1,) each [m]. In errors e = heading - target:

        left(j+1) = left(j) + ahead · (e(j) - bend(j)/2) + aside + aside_gain · u(j) + side_gain · v(j)
        e(j+1) = e(j) + bias + gain u(j) + memory u(j-1) + side_turns · v(j) - bend(j),  bend(j) = target(j+1) - target(j)
        minimise sum (left/aside weight)² + (e/turned weight)² + (change of u/change weight)² + (change of v/its weight)²
                     + inside · (way out of bounds)
        within limits on the turns u, the sideways strides v, and their changes

    On an arc that the robot follows exactly, the path moves aside by ahead · bend/2 in each cycle, as the robot does.
    """
    N = len(targets) - 1
    program = MathematicalProgram()
    u, v = (program.NewContinuousVariables(N, name) for name in ("turn", "side"))
    y, e = (program.NewContinuousVariables(N + 1, name) for name in ("left", "heading error"))
    first = np.arctan2(np.sin(heading - targets[0]), np.cos(heading - targets[0]))
    program.AddBoundingBoxConstraint([left, first], [left, first], [y[0], e[0]])
    own, turning = m.bias + bias, np.diff(targets)
    I, before_u, steps = np.eye(N), np.eye(N, k=-1), np.diff(np.eye(N + 1), axis=0)
    moved = np.hstack([steps, -m.ahead * np.eye(N, N + 1), -m.aside_gain * I, -m.side_gain * I])
    program.AddLinearEqualityConstraint(moved, m.aside - m.ahead * turning / 2, np.concatenate([y, e, u, v]))
    turned = np.hstack([steps, -m.gain * I - m.memory * before_u, -m.side_turns * I])
    right = own - turning
    right[0] += m.memory * before.turn
    program.AddLinearEqualityConstraint(turned, right, np.concatenate([e, u, v]))
    D = I - before_u
    for w, first_w, most, change, weight in ((u, before.turn, o.most, o.most_change, o.change),
                                             (v, before.side, o.most_side, o.most_side_change, o.side_change)):
        start = np.zeros(N)
        start[0] = first_w
        program.AddBoundingBoxConstraint(-most, most, w)
        program.AddLinearConstraint(D, start - change, start + change, w)
        program.Add2NormSquaredCost(D / weight, start / weight, w)
    program.AddQuadraticErrorCost(np.eye(N + 1) / o.aside**2, np.zeros(N + 1), y)
    program.AddQuadraticErrorCost(np.eye(N + 1) / o.turned**2, np.zeros(N + 1), e)
    if bounds is not None:
        _add_bounds(program, y, bounds, o)
    result = ClarabelSolver().Solve(program)
    if not result.is_success():  # the limits on turns and sides alone are always met together
        raise RuntimeError(f"the quadratic programme of {N} cycles was not solved: {result.get_solution_result()}")
    return Planned(*(np.asarray(result.GetSolution(w)) for w in (u, v, y, e)))


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
