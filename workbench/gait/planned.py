"""Motions for which the kino-centroidal programme is solved: seeds of a request, and twenty tasks that try it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from workbench.gait.machine import GaitMachine
from workbench.gait.request import Request
from workbench.gait.shape import KNEES, GaitShape
from workbench.gait.table import paths_of
from workbench.gait.trajopt import Planned, Task, plan

MODEST, MODEST_TURN = 0.2, 0.5
"""Speeds [m/s, rad/s] of seeds where a request has none: CMA-ES continues from there."""
PLANNED = ((2.4, 1.0), (2.4, 1.2), (3.0, 1.0), (3.0, 1.2), (3.0, 1.4))
"""Frequencies [Hz] and shares of the required speed of the programmes that a request is planned by; tables go a tenth slower than
their plans."""
LIFT, CROUCH = 0.11, 0.15
"""By leg length: low enough that bent hind knees keep their range with the lead that the inverse servo law adds."""


def planned_seeds(machine: GaitMachine, request: Request) -> tuple[GaitShape, ...]:
    """Shapes of solved programmes for a request: trots at the speed asked for, or at MODEST, knees both back, and the front ones
    forward if that is allowed."""
    speed = request.speed if request.speed is not None else MODEST_TURN if request.way == "turn" else MODEST
    velocity, turn = motion_of(request, speed)
    knees = KNEES[:1] if request.built_knees else (KNEES[0], KNEES[2])
    length = machine.leg_length
    trot = GaitShape("trot", poses=12, frequency=2.4, duty=0.6, lift=LIFT * length, crouch=CROUCH * length)
    plans = [plan(machine, Task(str(k), replace(trot, knees=k), velocity, turn, request.slope)) for k in knees]
    return tuple(p.shape for p in plans if p.solved)


def table_shape(machine: GaitMachine, planned: Planned) -> GaitShape:
    """The shape whose table goes through the programme's own joint path, a pose for each knot: offsets are the difference
    from the nearest foot path. Goals lead by the inverse servo law, as those of any shape do."""
    shape = replace(planned.shape, poses=len(planned.q), lead=1.0, offsets=())
    (paths,) = paths_of(machine, [shape])
    extra = np.roll(planned.q, -1, axis=0) - paths.q  # a cycle's poses begin to arrive a knot after its start
    return replace(shape, offsets=tuple(tuple(row) for row in extra.tolist()))


def tasks_of(request: Request, machine: GaitMachine) -> list[Task]:
    """The programmes that a request is planned by: trots and walks at its speed and beyond it, of several frequencies and ways of
    the knees."""
    speed = request.speed if request.speed is not None else MODEST_TURN if request.way == "turn" else MODEST
    knees = KNEES[:1] if request.built_knees else (KNEES[0], KNEES[2])
    length = machine.leg_length
    out = []
    for way, (frequency, more) in product(knees, PLANNED):
        trot = GaitShape("trot", way, poses=12, frequency=frequency, duty=0.6, lift=LIFT * length, crouch=CROUCH * length)
        velocity, turn = motion_of(request, more * speed)
        name = f"trot of {frequency:g} Hz, knees {way}, {more:g} of the speed"
        out.append(Task(name, trot, velocity, turn, request.slope))
    return out


def motion_of(request: Request, speed: float) -> tuple[tuple[float, float], float]:
    """Velocity forward and left [m/s] and rate of turning [rad/s] of a request at a speed [m/s, for a turn rad/s]."""
    ways = {"forward": (speed, 0.0), "arc": (speed, 0.0), "backward": (-speed, 0.0), "sideways": (0.0, request.side * speed),
            "turn": (0.0, 0.0)}
    turn = request.side * (speed if request.way == "turn" else 0.0 if request.radius is None else speed / request.radius)
    return ways[request.way], turn


def bundled_tasks() -> Sequence[Task]:
    """Twenty tasks: forward and backward, sideways, turns, uphill, in all families."""
    trot = GaitShape("trot", (1, 1), 8, 2.4, duty=0.6, lift=0.02, crouch=0.04)
    crawl = replace(trot, family="crawl", frequency=1.0, duty=0.8)
    walk = replace(trot, family="walk", frequency=1.6, duty=0.7)
    return (
        *(Task(f"trot {v:g} m/s", trot, (v, 0.0)) for v in (0.05, 0.1, 0.2, 0.3)),
        Task("trot 0.4 m/s, 3.2 Hz", replace(trot, frequency=3.2), (0.4, 0.0)),
        *(Task(f"walk {v:g} m/s", walk, (v, 0.0)) for v in (0.05, 0.1, 0.15)),
        *(Task(f"crawl {v:g} m/s", crawl, (v, 0.0)) for v in (0.03, 0.06)),
        *(Task(f"trot backward {v:g} m/s", trot, (-v, 0.0)) for v in (0.1, 0.2)),
        Task("crawl backward 0.04 m/s", crawl, (-0.04, 0.0)),
        *(Task(f"trot sideways {v:g} m/s", trot, (0.0, v)) for v in (0.05, 0.1)),
        *(Task(f"turn {np.degrees(w):.0f} deg/s", trot, (0.0, 0.0), w) for w in np.radians([20.0, 40.0])),
        Task("arc of 0.5 m at 0.1 m/s", trot, (0.1, 0.0), 0.2),
        Task("uphill 15 deg 0.1 m/s", trot, (0.1, 0.0), 0.0, float(np.radians(15))),
        Task("pace 0.1 m/s", replace(trot, family="pace"), (0.1, 0.0)))
