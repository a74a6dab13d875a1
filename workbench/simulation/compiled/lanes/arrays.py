"""Data of several robots of one structure: arrays as in `compiled.arrays`, with the lane as a last axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workbench.simulation.compiled.arrays import Ints, Numbers, Schedule, Servos, State, Tree
from workbench.simulation.compiled.number import LANES
from workbench.types import Array


class LaneServos(NamedTuple):
    """As `Servos`. terms, varies: in any lane; lags: whether any goal does. Of those a lane lacks, a number changes nothing."""

    joint: Numbers
    terms: bool
    varies: bool
    lags: bool
    zero: Array
    gain: Array
    margin: Array
    punch: Array
    full_torque: Array
    back_emf: Array
    coulomb: Array
    derivative: Array
    ramp: Array
    lag: Array
    most: Array
    ceiling: Array
    supply: Array
    rubbing: Array
    backwards: Array
    bend: Array
    fade: Array
    sag: Array
    sticking: Array
    speed: Array
    still: Array
    still_speed: Array
    lopsided: Array


class Room(NamedTuple):
    """As `Work`. active (g,): 1 where a tree of the forest has friction or limits; limit_v: minus infinity of a limit that is
    far. lane_R (n+1, 3, 3): rotations of bodies of one lane, without an axis of lanes."""

    R: Array
    p: Array
    S: Array
    mass: Array
    moment: Array
    inertia: Array
    V: Array
    A: Array
    F: Array
    M: Array
    H: Array
    force: Array
    v_star: Array
    v_next: Array
    momentum: Array
    momentum_star: Array
    gradient: Array
    scale: Array
    dv: Array
    dp: Array
    brake_gain: Array
    limit_R: Array
    limit_v: Array
    active: Array
    push: Array
    motor: Array
    relief: Array
    lane_R: Array


_OF_TREE = ("R", "p", "axis", "mass", "com", "inertia", "armature", "damping", "stiffness", "rest", "lower", "upper", "brake",
            "brake_gain", "gravity")
"""Numbers of a tree; the others are the same in all lanes."""
_OF_SERVOS = ("zero", "gain", "margin", "punch", "full_torque", "back_emf", "coulomb", "derivative", "ramp", "lag", "most",
              "ceiling", "supply", "rubbing", "backwards", "bend")
_BY_TERM = {"sag": 0.0, "sticking": 0.0, "speed": 1.0, "still": 0.0, "still_speed": 1.0, "lopsided": 0.0}
"""Numbers by term, and those of a term that changes nothing."""


def _room(shapes: Sequence[tuple[int, ...]]) -> list[Array]:
    """Zeros (*shape, LANES) of each shape, placed as kernels need them."""
    sizes = [math.prod(shape) * LANES for shape in shapes]
    raw = np.zeros(sum(sizes) + LANES)
    end, out = (-raw.ctypes.data // raw.itemsize) % LANES, []
    for shape, size in zip(shapes, sizes):
        begin, end = end, end + size
        out.append(raw[begin:end].reshape(*shape, LANES))
    return out


def _in_lanes(robots: Sequence[Sequence[Array]]) -> list[Array]:
    """Arrays of up to LANES robots, of the same shapes for each: each array of all robots side by side; the last robot also in
    the lanes that are left over."""
    out = _room([a.shape for a in robots[0]])
    numbers = np.array([np.concatenate([a.ravel() for a in arrays]) for arrays in robots]).T
    end = 0
    for array in out:
        begin, end = end, end + array.size // LANES
        flat = array.reshape(-1, LANES)
        flat[:, :len(robots)] = numbers[begin:end]
        flat[:, len(robots):] = numbers[begin:end, -1:]
    return out


def trees_in_lanes(trees: Sequence[Tree]) -> Tree:
    """Of one structure."""
    numbers: dict[str, Any] = dict(zip(_OF_TREE, _in_lanes([[getattr(t, name) for name in _OF_TREE] for t in trees])))
    return trees[0]._replace(**numbers)


def servos_in_lanes(servos: Sequence[Servos]) -> LaneServos:
    """Of as many servos on the same joints, without tables."""
    terms = {name: max(len(getattr(s, name)) for s in servos) for name in _BY_TERM}
    numbers = _in_lanes([[*(getattr(s, name) for name in _OF_SERVOS), np.array([s.fade]),
                          *(_lengthened(getattr(s, name), terms[name], nothing) for name, nothing in _BY_TERM.items())]
                         for s in servos])
    return LaneServos(joint=servos[0].joint, terms=any(s.terms for s in servos), varies=any(s.varies for s in servos),
                      lags=any(bool(s.lag.any()) for s in servos), **dict(zip((*_OF_SERVOS, "fade", *_BY_TERM), numbers)))


def _lengthened(rows: Array, count: int, by: float) -> Array:
    """As many rows as `count`, those that are missing full of one number."""
    missing = count - len(rows)
    return np.concatenate([rows, np.full((missing, *rows.shape[1:]), by)]) if missing else rows


def schedules_in_lanes(schedules: Sequence[Schedule]) -> tuple[Schedule, Ints, Ints]:
    """Schedules of up to LANES robots, which differ in their commands alone, as one schedule with the commands of every robot in
    turn; and each lane's first command (LANES,) and the end of its commands. Unused lanes do as the last robot does."""
    own = list({id(s): s for s in schedules}.values())
    ends = np.cumsum([len(s.command_step) for s in own])
    which = [next(k for k, s in enumerate(own) if s is mine) for mine in schedules]
    which += which[-1:] * (LANES - len(which))
    end = np.array([ends[k] for k in which], dtype=np.int64)
    first = np.array([ends[k] - len(own[k].command_step) for k in which], dtype=np.int64)
    if len(own) == 1:
        return own[0], first, end
    commands: dict[str, Any] = {name: np.concatenate([getattr(s, name) for s in own])
                                for name in ("command_step", "late", "goal", "speed", "on")}
    return own[0]._replace(**commands), first, end


def states_in_lanes(states: Sequence[State]) -> State:
    """That differ in numbers, but not in which servos are on or whether there was a step."""
    names = ("q", "v", "reference", "goal", "lagging", "reach", "memory")
    numbers = _in_lanes([[getattr(s, name) for name in names] for s in states])
    return State(base=states[0].base, on=states[0].on.copy(), stepped=states[0].stepped.copy(), **dict(zip(names, numbers)))


def state_of_lane(states: State, i: int) -> State:
    """A lane's own."""
    own: dict[str, Any] = {name: np.ascontiguousarray(a[..., i]) for name, a in zip(State._fields, states)
                           if name not in ("base", "on", "stepped")}
    return State(base=states.base.copy(), on=states.on.copy(), stepped=states.stepped.copy(), **own)


def room_for(tree: Tree, servos: LaneServos) -> Room:
    """For runs of robots of a structure."""
    n, m = len(tree.parent), len(servos.joint)
    groups = int(tree.group.max(initial=0)) + 1
    shapes: dict[str, tuple[int, ...]] = {
        "R": (n + 1, 3, 3), "p": (n + 1, 3), "S": (n, 6), "mass": (n + 1,), "moment": (n + 1, 3), "inertia": (n + 1, 6),
        "V": (n + 1, 6), "A": (n + 1, 6), "F": (n + 1, 6), "M": (n, n), "H": (n, n), "limit_v": (n, 2), "active": (groups,),
        "push": (m,), "motor": (m,), "relief": (m,)}
    names = [name for name in Room._fields if name != "lane_R"]
    return Room(lane_R=np.zeros((n + 1, 3, 3)), **dict(zip(names, _room([shapes.get(name, (n,)) for name in names]))))


Lost = NDArray[np.bool_]
