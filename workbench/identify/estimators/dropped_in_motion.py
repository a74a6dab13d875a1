"""Poses that a servo never received while it was moving: a fast gait has no rests that would show it, but simulation does.

Where a joint that followed the model begins to lag with a pose, that pose is removed from the played commands, and is taken for
missed if the joint then moves as recorded, until it lags again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

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


def ends_of(e: TakeEvidence) -> Array:
    """For each command, the time when the next one comes [s]; for the last, the end."""
    commands = e.take.commands
    assert commands is not None
    return np.append(commands.times, commands.end)[1:]


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
        guilty = {(i, j): _explaining(evaluator.evidence[i], j, poses, now[i], after[i]) for (i, j), poses in new.items()}
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
            behind = _lagging(e, joint, {k: way for k, way in moves.items() if (i, joint, k) not in cleared}, now[i])
            if behind and len(behind) + len(gone) <= READ_OFF.most_dropped_in_motion * (len(moves) + len(gone)):
                following = {k + 1 for k in behind}
                out[i, joint] = tuple(k for k in behind if k not in following)
    return out


def steps(e: TakeEvidence, joint: str, gone: Sequence[int]) -> dict[int, float]:
    """Poses that move a joint and that it received, and the change of its goal [rad]."""
    commands = e.take.commands
    assert commands is not None
    column, missed = commands.column(joint), set(gone)
    ways = np.diff(without_poses(commands, column, gone).goals[:, column], prepend=0.0)
    return {k: float(ways[k]) for k in np.flatnonzero(np.abs(ways) >= READ_OFF.least_step).tolist() if k not in missed}


def _lagging(e: TakeEvidence, joint: str, moves: Mapping[int, float], residual: Array) -> list[int]:
    """The poses, in order, before which the joint followed and after which it lags until the next pose. moves: changes of the
    joint's goal [rad] by pose."""
    error = residual[:, e.channels.index(joint)]
    before, came, until = _frames(e)
    out = []
    for k, way in moves.items():
        was, then = (-np.sign(way) * error[a:b] for a, b in ((before[k], came[k]), (came[k], until[k])))
        was, then = was[np.isfinite(was)], then[np.isfinite(then)]
        if len(then) and np.all(np.abs(was) < READ_OFF.calm) and then.max() > max(READ_OFF.behind, -then.min()):
            out.append(k)
    return out


def _explaining(e: TakeEvidence, joint: str, poses: Sequence[int], before: Array, after: Array) -> tuple[int, ...]:
    """The poses without which the joint moves as recorded until the next pose. before, after: residuals of the take with and
    without all of these poses."""
    channel = e.channels.index(joint)
    _, came, until = _frames(e)
    out = []
    for k in poses:
        had, has = (r[came[k]:until[k], channel] for r in (before, after))
        own = np.isfinite(had)
        was, now = (float(np.sum(r[own] ** 2)) for r in (had, has))
        if was - now > READ_OFF.pose_explains * (was - own.sum()):
            out.append(k)
    return tuple(out)


def _frames(e: TakeEvidence) -> tuple[NDArray[np.int_], NDArray[np.int_], NDArray[np.int_]]:
    """Indices of three frames for each command: the first that shows the joint before the command, the first that shows its
    effect, and the first that may show the effect of the next one."""
    commands, time = e.take.commands, e.since
    assert commands is not None
    instants = (commands.times - READ_OFF.before, commands.times, ends_of(e) + READ_OFF.lag)
    before, came, until = (np.searchsorted(time, t, side="right") for t in instants)
    return before, came, until
