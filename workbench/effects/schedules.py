"""Command schedules in which joints get their poses at different times."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from workbench.motion.commands import Commands

LOOP = 2e-3
"""Between a command's stated time and what the servo's loop makes of it [s]: engines and firmwares differ by that, so that every
model may set out that much sooner or later, and no delay is known better."""


def without_poses(commands: Commands, column: int, missed: Iterable[int]) -> Commands:
    """The commands without some to one joint, which keeps the goal and speed that it had."""
    goals, speeds = commands.goals.copy(), commands.speeds.copy()
    for k in sorted(missed):
        goals[k, column] = goals[k - 1, column] if k else 0.0
        speeds[k, column] = speeds[k - 1, column] if k else 0.0
    return replace(commands, goals=goals, speeds=speeds)


def delayed(commands: Commands, columns: Iterable[int], late: float) -> Commands:
    """The commands of some columns `late` seconds later; between its own instants, a joint keeps its last."""
    columns = list(columns)
    if not late:
        return commands
    if len(columns) == len(commands.joints):
        return replace(commands, times=commands.times + late, end=commands.end + late)
    times = np.union1d(commands.times, commands.times + late)
    shift = np.zeros(len(commands.joints))
    shift[columns] = late
    row = np.array([np.searchsorted(commands.times, times - s + 1e-9, side="right") - 1 for s in shift]).T  # (times, joints)
    column = np.arange(len(commands.joints))
    waiting = row < 0  # still in neutral
    held = np.maximum(row, 0)
    goals, speeds, enabled = (np.where(waiting, neutral, rows[held, column]) for rows, neutral in (
        (commands.goals, 0.0), (commands.speeds, 0.0), (commands.enabled, True)))
    poses = commands.poses[np.maximum(np.searchsorted(commands.times, times + 1e-9, side="right") - 1, 0)]
    told = np.isin(times, commands.times)  # else instants would double with each joint that is late by a delay of its own
    for values in (goals, speeds, enabled):
        told[1:] |= (values[1:] != values[:-1]).any(axis=1)
    told[0] |= not waiting[0].all()
    return Commands(times[told], commands.joints, goals[told], speeds[told], enabled[told], commands.end + late, poses[told])
