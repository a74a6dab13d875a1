"""Finds joints whose goals follow their positions: the two columns are exchanged."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workbench.files.problem import CorrectedProblem
from workbench.recording.recording import Recording
from workbench.recording.servo_log.following import JointLog, joint_logs
from workbench.recording.servo_log.response import fit_response, shapes
from workbench.types import Array


@dataclass(frozen=True)
class RoleChecks:
    """unexplained: largest share of the goal's variance that the position, delayed and smoothed as by a servo, does not explain;
    better: and so many times less than the goal does not explain of the position's. steps: the positions change in at most so
    many times the rows in which the goals do. goes: least motion of both [deg]."""

    unexplained: float = 0.1
    better: float = 4.0
    steps: float = 0.5
    goes: float = 5.0


ROLES = RoleChecks()


def reversed_roles(r: Recording, c: RoleChecks = ROLES) -> Iterator[tuple[str, str]]:
    """Name and a line of each joint whose goals follow its positions and not the other way round, where the positions
    are set points, which stand and then step; of smooth ones, a lead is reported instead (`lead`)."""
    for joint, log in joint_logs(r).items():
        if np.rad2deg(min(np.ptp(log.goal), np.ptp(log.position))) < c.goes or not _steps(log, c):
            continue
        answer = _unexplained_share(log, log.position, log.goal)
        if answer < c.unexplained and c.better * answer < _unexplained_share(log, log.goal, log.position):
            yield joint, CorrectedProblem(f"goal.{joint}: follows position.{joint}, as only a position follows its goal: are the "
                                          "two columns exchanged? The joint's evidence is left out")


def _steps(log: JointLog, c: RoleChecks) -> bool:
    return bool(np.mean(np.diff(log.position) != 0) < c.steps * np.mean(np.diff(log.goal) != 0))


def _unexplained_share(log: JointLog, cause: Array, effect: Array) -> float:
    fit = fit_response(shapes(log.time, cause), effect)
    return float(np.mean((effect - fit.predicted) ** 2) / np.var(effect)) if fit.gain > 0 else 1.0
