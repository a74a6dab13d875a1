"""Command schedules in which joints get their poses at different times."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from workbench.motion.commands import Commands

LOOP = 2e-3
"""Between a command's stated time and what the servo's loop makes of it [s]: engines and firmwares differ by that, so that every
model may set out that much sooner or later, and no delay is known better."""

SAME = 1e-9
"""Instants no further apart are one [s]."""


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
    own = [commands.goals[:, columns], commands.speeds[:, columns], commands.enabled[:, columns]]
    changes = np.zeros(len(commands.times), dtype=bool)  # else instants double with each joint
    for values, neutral in zip(own, (0.0, 0.0, True)):
        changes |= (values != np.vstack([np.full_like(values[:1], neutral), values[:-1]])).any(axis=1)
    changes[:1] |= late < 0
    times = np.union1d(commands.times, commands.times[changes] + late)
    times = times[np.diff(times, prepend=-np.inf) > SAME]
    now, before = (np.searchsorted(commands.times, times - s + SAME, side="right") - 1 for s in (0.0, late))
    still, first, shifted = (now < 0)[:, None], np.maximum(now, 0), np.maximum(before, 0)  # still in neutral

    def held(rows: np.ndarray, neutral: float) -> np.ndarray:
        out = np.where(still, neutral, rows[first])
        out[:, columns] = np.where(before[:, None] < 0, neutral, rows[shifted][:, columns])
        return out

    return Commands(times, commands.joints, held(commands.goals, 0.0), held(commands.speeds, 0.0),
                    held(commands.enabled, True).astype(bool), commands.end + late, commands.poses[first])
