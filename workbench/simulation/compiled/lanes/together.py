"""Runs of many held robots: those of one structure in lanes, the others one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from workbench.robot import puppy_model
from workbench.simulation.compiled.arrays import Schedule, Shapes, State, Tree
from workbench.simulation.compiled.lanes.arrays import (
    LaneServos,
    Lost,
    Room,
    room_for,
    schedules_in_lanes,
    servos_in_lanes,
    state_of_lane,
    states_in_lanes,
    trees_in_lanes,
)
from workbench.simulation.compiled.lanes.play import play_lanes
from workbench.simulation.compiled.number import LANES
from workbench.simulation.compiled.schedule import settling
from workbench.simulation.compiled.station import CompiledJob, announced
from workbench.simulation.compiled.tables import NotCoveredError
from workbench.simulation.config import SimulationConfig
from workbench.simulation.job import Job
from workbench.types import Array

Play = tuple[CompiledJob, Schedule]


class _Robots(NamedTuple):
    """Up to LANES of them, as the kernel takes them."""

    trees: Tree
    servos: LaneServos
    shapes: Shapes
    room: Room


def joint_angles(plays: Sequence[Play], in_lanes: bool = True) -> list[Array | NotCoveredError]:
    """Angles (rows, n) [rad] of all joints at the rows of each run's log, or why it has to be Drake's.

    In lanes go held robots without torque tables, those of one structure that are put to the same states together: they may
    differ in masses, springs, play, limits, friction, gravity, in everything that servos do, and in their commands. A lane in
    which links touch is played again alone. Who plays along changes no bit of a robot's angles, so that even one is played in
    lanes. in_lanes: False plays each alone, by the kernel of one robot; angles are the same to rounding. On a processor without
    vectors they are, too, but nothing is gained.
    """
    out: list[Array | NotCoveredError | None] = [None] * len(plays)
    robots: dict[tuple[int, ...], _Robots] = {}
    for here in _in_step(plays) if in_lanes else ():
        chunk = [plays[k][0] for k in here]
        key = tuple(id(c.machine) for c in chunk)
        if key not in robots:
            trees, servos = trees_in_lanes([c.machine.tree for c in chunk]), servos_in_lanes([c.machine.servos for c in chunk])
            robots[key] = _Robots(trees, servos, chunk[0].machine.shapes, room_for(trees, servos))
        for k, q in zip(here, _played(chunk, [plays[k][1] for k in here], robots[key])):
            out[k] = q
    return [_alone(*play) if q is None else q for play, q in zip(plays, out)]


def _alone(job: CompiledJob, schedule: Schedule) -> Array | NotCoveredError:
    try:
        return job.log(schedule).q
    except NotCoveredError as why:
        return why


def _in_step(plays: Sequence[Play]) -> Iterator[list[int]]:
    """Which plays go together; those with the same kinds of effects next to each other."""
    groups: dict[object, list[int]] = {}
    for k, (job, schedule) in enumerate(plays):
        tree, servos, shapes = job.machine
        if not tree.free and not len(servos.table_servo):
            structure = [a.tobytes() for a in (tree.parent, tree.path, tree.group, servos.joint, *shapes)]
            kind = _when(job, schedule), job.rows, servos.terms, *structure  # terms have a servo that is off brake otherwise
            groups.setdefault(kind, []).append(k)
    for group in groups.values():
        group.sort(key=lambda k: _terms(plays[k][0]))
        for begin in range(0, len(group), LANES):
            yield group[begin:begin + LANES]


def _when(job: CompiledJob, schedule: Schedule) -> object:
    """Equal where schedules differ in their goals at most, and in when these come: a servo's delay is its own. Lanes are switched
    on and off together, so that a schedule which does that is only itself."""
    if not schedule.on.all():
        return id(schedule)
    return schedule.dt, schedule.steps, schedule.log_every, schedule.begin, id(job.job.restarts)


def _terms(job: CompiledJob) -> tuple[int, ...]:
    s = job.machine.servos
    return s.varies, len(s.speed), len(s.still_speed), len(s.lopsided), len(s.sag), bool(s.lag.any())


def _played(chunk: Sequence[CompiledJob], schedules: Sequence[Schedule], robots: _Robots) -> list[Array | None]:
    """Angles of each; None of one that has to be played alone."""
    fit = np.ones(len(chunk), dtype=bool)
    if not all(c.is_settled for c in chunk):
        states = states_in_lanes([_upright(c) for c in chunk])
        _, fit = _run(chunk, [settling(chunk[0].config, len(chunk[0].model.joints))], states, 0, robots)
        for i, c in enumerate(chunk):
            if fit[i] and not c.is_settled:
                c.settle(state_of_lane(states, i))
    states = states_in_lanes([c.begin() if c.is_settled else _upright(c) for c in chunk])
    q, well = _run(chunk, schedules, states, chunk[0].rows, robots)
    return [q[i] if fit[i] and well[i] else None for i in range(len(chunk))]


def _run(chunk: Sequence[CompiledJob], schedules: Sequence[Schedule], states: State, rows: int, robots: _Robots
         ) -> tuple[Array, Lost]:
    """Angles (LANES, rows, n) from states on, and in which lanes they are good. schedules: of each, or one for all."""
    schedule, at, end = schedules_in_lanes(schedules)
    q, lost = np.empty((LANES, rows, len(robots.trees.parent))), np.zeros(LANES, dtype=bool)
    announced(lambda: play_lanes(*robots[:3], schedule, at, end, states, q, lost, robots.room), play_lanes)
    return q, ~lost[:len(chunk)]


def compile_lanes() -> None:
    """Compiles the kernel of several robots, unless this machine keeps it for this checkout: plays a millisecond."""
    job = CompiledJob(Job(puppy_model(), SimulationConfig(base="fixed", settle=1e-3), duration=1e-3, lead=0.0, times=np.zeros(1)))
    joint_angles([(job, job.schedule())])


def _upright(job: CompiledJob) -> State:
    state = job.neutral()
    state.q[job.machine.servos.joint] = job.machine.servos.zero
    return state
