"""Poses that a servo never received while it was moving: a fast gait has no rests that would show it, but simulation does.

Where a joint that followed the model begins to lag with a pose, that pose is removed from the played commands, and is taken for
missed if the joint then moves as recorded, until it lags again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from workbench.effects.schedules import without_poses
from workbench.identify.options import READ_OFF
from workbench.identify.problem import TakeEvidence
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.robot import RobotModel
from workbench.types import Array

DroppedPoses = dict[tuple[int, str], tuple[int, ...]]
"""Poses by take and joint."""


def played_without(evaluator: RolloutEvaluator, lost: Mapping[tuple[int, str], Sequence[int]]) -> RolloutEvaluator:
    """The evaluator whose takes are played without some poses, by take and joint."""
    evidence = list(evaluator.evidence)
    for (i, joint), poses in lost.items():
        take = evidence[i].take
        assert take.commands is not None
        commands = without_poses(take.commands, take.commands.column(joint), poses)
        evidence[i] = replace(evidence[i], take=replace(take, commands=commands))
    return evaluator.on(evidence)


def end_of(e: TakeEvidence, k: int) -> float:
    """When the next command comes [s]."""
    commands = e.take.commands
    assert commands is not None
    return float(commands.times[k + 1] if k + 1 < len(commands.times) else commands.end)


def dropped_in_motion(evaluator: RolloutEvaluator, nominal: RobotModel, residuals: Mapping[int, Array]) -> DroppedPoses:
    """Poses that were missed in motion. residuals: of the nominal robot, by take."""
    lost: DroppedPoses = {}
    cleared: set[tuple[int, str, int]] = set()
    now = dict(residuals)
    for _ in range(READ_OFF.turns):
        new = suspects(evaluator, now, lost, cleared)
        if not new:
            break
        both = {at: (*lost.get(at, ()), *new.get(at, ())) for at in {*lost, *new}}
        after = _residuals_without(evaluator, nominal, both, residuals)
        guilty = {(i, j): tuple(k for k in poses if _is_explained(evaluator.evidence[i], j, k, now[i], after[i]))
                  for (i, j), poses in new.items()}
        cleared |= {(*at, k) for at, poses in new.items() for k in poses if k not in guilty[at]}
        found = {at: tuple(sorted((*lost.get(at, ()), *poses))) for at, poses in guilty.items() if poses}
        if not found:
            break
        lost |= found
        now = after if guilty == new else _residuals_without(evaluator, nominal, lost, residuals)
    return lost


def _residuals_without(
    evaluator: RolloutEvaluator, nominal: RobotModel, lost: DroppedPoses, residuals: Mapping[int, Array]
) -> dict[int, Array]:
    """Residuals without these poses."""
    takes = tuple(sorted({i for i, _ in lost}))
    return dict(residuals) | played_without(evaluator, lost).residuals([RolloutRequest(nominal, takes)])[0]


def suspects(
    evaluator: RolloutEvaluator, now: Mapping[int, Array], lost: DroppedPoses, cleared: set[tuple[int, str, int]]
) -> DroppedPoses:
    """Poses with which joints that followed the model begin to lag; of several in a row the first, since the effect of one shows
    with the next, and with both removed neither would be accepted."""
    out: DroppedPoses = {}
    for i, e in enumerate(evaluator.evidence):
        for joint in e.joints if e.take.commands is not None else ():
            gone = lost.get((i, joint), ())
            moves = steps(e, joint, gone)
            behind = tuple(k for k, way in moves.items() if (i, joint, k) not in cleared and _begins(e, joint, k, way, now[i]))
            if behind and len(behind) + len(gone) <= READ_OFF.most_dropped_in_motion * (len(moves) + len(gone)):
                out[i, joint] = tuple(k for k in behind if k - 1 not in behind)
    return out


def steps(e: TakeEvidence, joint: str, gone: Sequence[int]) -> dict[int, float]:
    """Poses that move a joint and that it received, and the change of its goal [rad]."""
    commands = e.take.commands
    assert commands is not None
    column = commands.column(joint)
    ways = np.diff(without_poses(commands, column, gone).goals[:, column], prepend=0.0)
    return {k: float(way) for k, way in enumerate(ways) if abs(way) >= READ_OFF.least_step and k not in gone}


def _begins(e: TakeEvidence, joint: str, k: int, way: float, residual: Array) -> bool:
    """Whether a joint was well when a command came, and stays behind until the next does."""
    own = -np.sign(way) * residual[:, e.channels.index(joint)]
    came, until = _between(e, k)
    time = e.take.recorded.since_start
    was, then = own[(time > came - READ_OFF.before) & (time <= came)], own[(time > came) & (time <= until)]
    was, then = was[np.isfinite(was)], then[np.isfinite(then)]
    return bool(len(then)) and bool(np.all(np.abs(was) < READ_OFF.calm)) and bool(then.max() > max(READ_OFF.behind, -then.min()))


def _is_explained(e: TakeEvidence, joint: str, k: int, before: Array, after: Array) -> bool:
    """Whether a joint goes as recorded without a pose, until the next came."""
    came, until = _between(e, k)
    time, channel = e.take.recorded.since_start, e.channels.index(joint)
    own = (time > came) & (time <= until) & np.isfinite(before[:, channel])
    was, now = (float(np.sum(r[own, channel] ** 2)) for r in (before, after))
    return bool(was - now > READ_OFF.pose_explains * (was - own.sum()))


def _between(e: TakeEvidence, k: int) -> tuple[float, float]:
    """When a command arrived [s], and until when its effect can be seen alone."""
    commands = e.take.commands
    assert commands is not None
    return float(commands.times[k]), end_of(e, k) + READ_OFF.lag
