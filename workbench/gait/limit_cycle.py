"""Whether a gait is one limit cycle: entered in other ways and disturbed, the robot comes back to the same steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.gait.cycles import Scatter, cycles_of, scatter_of
from workbench.gait.rollouts import Rollouts
from workbench.gait.table import GaitTable
from workbench.motion import Commands, PoseTable
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.simulation.rollout import BaseState, Start
from workbench.types import Array

PUSH = 0.1
"""Sideways velocity [m/s] that a push gives the body: a third of a fast gait's speed, 0.15 N s on the puppy."""
SHARE, LEAST_SPEED, LEAST_TURN = 0.1, 0.02, math.radians(2)
"""A cycle is the gait's own where forward and sideways speed and turn are within a tenth of it, or 0.02 m/s and 2 deg, or three
standard deviations of the settled gait's cycles."""
SETTLED = 5
"""Cycles that tell the settled gait: the last of the run from neutral."""
STAYS = 3
"""Cycles that have to be the gait's own at a run's end."""
LEAD = 0.3
"""At rest before the first command [s]."""


@dataclass(frozen=True)
class Return:
    """One way into the gait. cycles: after how many whole ones all that follow are the gait's own; None: it did not come back
    while it was watched. fell: whether it lay down instead."""

    entry: str
    cycles: int | None
    fell: bool = False


@dataclass(frozen=True)
class LimitCycle:
    """scatter: of the run from neutral. returns: of each way in. watched: for how many cycles."""

    scatter: Scatter
    returns: tuple[Return, ...]
    watched: int

    @property
    def slowest(self) -> Return:
        """The way in that takes longest, or from which it does not come back."""
        return max(self.returns, key=lambda r: math.inf if r.cycles is None else r.cycles)


@dataclass(frozen=True, eq=False)
class _Entry:
    """commands: from time 0 on. begin: when a whole cycle of the loop begins from which cycles are counted [s]. start: where the
    robot is at time 0; None: at rest in neutral."""

    name: str
    commands: Commands
    begin: float
    start: Start | None = None


def limit_cycle(model: RobotModel, table: GaitTable, watched: int, step: float = 1e-3, other: PoseTable | None = None,
                ) -> LimitCycle:
    """Plays the gait from neutral, and again disturbed, on one robot. watched: cycles of each run. step: of the simulation [s].
    other: another table, from whose middle the gait is entered, too."""
    config = SimulationConfig(base="free", time_step=step, contact_period=0.0, log_period=0.01)
    period, rollouts = table.period, Rollouts(1)

    def run(entries: Sequence[_Entry]) -> list[Take]:
        jobs = [Job(model, config, e.commands, e.begin + watched * period, LEAD, start=e.start, name=e.name) for e in entries]
        return [simulate_batch([replace(job, config=replace(config, engine="drake"))])[0] if take is None else take
                for job, take in zip(jobs, rollouts.takes(jobs))]  # whatever the compiled station gives up is Drake's

    neutral = _Entry("from neutral", table.commands(watched), table.start_seconds)
    (first,) = run([neutral])
    own = cycles_of(first, neutral.begin, period)
    scatter = scatter_of(own[-SETTLED:])
    entries = [*_entries(table, watched, other), _push(first, table, watched, model)]
    returns = [came_back(neutral.name, first, own, own)]
    returns += [came_back(e.name, take, cycles_of(take, e.begin, period), own) for e, take in zip(entries, run(entries))]
    return LimitCycle(scatter, tuple(returns), watched)


def came_back(name: str, take: Take, cycles: Array, own: Array) -> Return:
    """After how many of its cycles (N, 3) a run is the gait that `own` (N, 3), the cycles from neutral, settles in; both as
    `cycles_of` gives them."""
    assert take.quat_WB is not None
    settled = own[-SETTLED:]
    mean = settled.mean(axis=0)
    size = np.array([np.hypot(*mean[:2])] * 2 + [abs(mean[2])])
    allowed = np.maximum(np.maximum(SHARE * size, [LEAST_SPEED, LEAST_SPEED, LEAST_TURN]), 3 * settled.std(axis=0))
    strange = np.flatnonzero((np.abs(cycles - mean) > allowed).any(axis=1))
    back = int(strange[-1]) + 1 if len(strange) else 0
    fell = bool((1 - 2 * (take.quat_WB[:, 1]**2 + take.quat_WB[:, 2]**2)).min() < math.cos(math.radians(60)))
    return Return(name, back if back + STAYS <= len(cycles) and not fell else None, fell)


def _entries(table: GaitTable, watched: int, other: PoseTable | None) -> list[_Entry]:
    """The entries that are tried: into the loop at full speed from neutral, at three phases; with a pose that got lost; from
    another table."""
    loop, period = table.cycle, table.period
    every = loop.commands(watched + 1)
    out = []
    for share, name in ((0.0, "at once"), (1 / 3, "at once, a third of a cycle on"), (2 / 3, "at once, two thirds on")):
        first = round(share * len(loop))
        begin = float(every.times[first])
        rest = float(every.times[len(loop)]) - begin if first else 0.0  # to the next whole cycle
        out.append(_Entry(name, _from(every, first), rest))
    walked = table.commands(3 + watched)
    lost = len(table.start) + 2 * len(loop) + len(loop) // 2
    out.append(_Entry("a pose got lost", _drop_command(walked, lost), table.start_seconds + 3 * period))
    if other is not None:
        out.append(_Entry("from another table", _after(other.commands(2), loop.commands(watched)), other.commands(2).end))
    return out


def _push(take: Take, table: GaitTable, watched: int, model: RobotModel) -> _Entry:
    """The run from neutral, continued from a beginning of its loop, with an additional velocity to the left."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    assert take.v is not None
    commands = table.commands(3 + watched)
    at = table.start_seconds + 2 * table.period
    k = int(np.searchsorted(take.time, at - 1e-9))
    k = min(max(k, 1), len(take) - 2)
    w, x, y, z = take.quat_WB[k]
    left = np.array([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 0.0])
    apart = take.time[k + 1] - take.time[k - 1]
    velocity = (take.p_WB[k + 1] - take.p_WB[k - 1]) / apart + PUSH * left / max(float(np.hypot(*left[:2])), 1e-9)
    order = [take.joints.index(j) for j in model.joints]
    base = BaseState(take.p_WB[k], take.quat_WB[k], _spin(take.quat_WB[k - 1], take.quat_WB[k + 1]) / apart, velocity)
    reference = commands.reordered(model.joints).reference(np.array([at - 1e-9]))[0]
    start = Start(take.q[k][order], take.v[k][order], base=base, reference=reference)
    first = int(np.searchsorted(commands.times, at - 1e-9))
    return _Entry("a push to the left", _from(commands, first), 0.0, start)


def _spin(before: Array, after: Array) -> Array:
    """Rotation vector in W from one attitude (4,) wxyz to another."""
    a, b = before[0], before[1:] * -1
    vector = after[0] * b + a * after[1:] + np.cross(after[1:], b)
    return np.asarray(2 * vector * np.sign(after[0] * a - after[1:] @ b))


def _from(c: Commands, first: int) -> Commands:
    """The commands from one of them on, which then is at time 0."""
    return Commands(c.times[first:] - c.times[first], c.joints, c.goals[first:], c.speeds[first:], c.enabled[first:],
                    c.end - float(c.times[first]), c.poses[first:])


def _drop_command(c: Commands, lost: int) -> Commands:
    """Without one of the commands."""
    kept = np.arange(len(c.times)) != lost
    return replace(c, times=c.times[kept], goals=c.goals[kept], speeds=c.speeds[kept], enabled=c.enabled[kept],
                   poses=c.poses[kept])


def _after(before: Commands, c: Commands) -> Commands:
    """One schedule followed by another."""
    c = c.reordered(before.joints)
    goals, speeds, enabled, poses = (np.concatenate([getattr(before, f), getattr(c, f)])
                                     for f in ("goals", "speeds", "enabled", "poses"))
    return Commands(np.concatenate([before.times, c.times + before.end]), c.joints, goals, speeds, enabled, before.end + c.end,
                    poses, before.begun)
