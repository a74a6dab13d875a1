"""Actions of a learner: turn and pace of a cycle, or offsets of the goals of one pose."""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np

from workbench.gait.drive.family import GaitFamily, Steer
from workbench.gait.learning.options import LearningOptions
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table, pose_table
from workbench.motion import Commands
from workbench.types import Array


class Actions(Protocol):
    """size: how many numbers an action has, each from -1 to 1. in_cycle: actions in a cycle. family: the gait that they change;
    start: from neutral into it."""

    size: int
    in_cycle: int
    family: GaitFamily

    @property
    def start(self) -> Commands:
        """Commands from neutral into the gait."""
        ...

    def commands(self, k: int, action: Array, before: Array) -> Commands:
        """Commands of the k-th action (size,) of an episode, after the action `before` (size,); its `end` is when it is over
        [s]."""
        ...

    def shape(self, mean: Array) -> GaitShape:
        """The gait whose every cycle consists of the actions `mean` (in_cycle, size)."""
        ...


class CycleActions:
    """One action a cycle: its turn, and its pace. 0, 0 is the gait itself."""

    size, in_cycle = 2, 1

    def __init__(self, family: GaitFamily, options: LearningOptions) -> None:
        self.family, self.options = family, options

    @property
    def start(self) -> Commands:
        """Commands from neutral into the gait."""
        return self.family.start.commands(1)

    def commands(self, k: int, action: Array, before: Array) -> Commands:
        """Commands of one cycle."""
        (turn, pace), (turn_before, pace_before) = self._meant(action), self._meant(before)
        return self.family.cycle(Steer(turn), Steer(turn_before), pace, pace_before).commands(1)

    def shape(self, mean: Array) -> GaitShape:
        """The gait with that turn and pace."""
        turn, pace = self._meant(mean[0])
        return self.family.shape_of(Steer(turn), pace)

    def _meant(self, action: Array) -> tuple[float, float]:
        """Turn [rad per stance] and pace."""
        turn, pace = float(action[0]), float(action[1])
        least, most = self.options.paces
        return turn * self.options.turn, 1.0 + pace * (most - 1.0 if pace > 0 else 1.0 - least)


class PoseActions:
    """An action for each pose of the gait's cycle: angles that are added to the goals of the legs' joints. Zeros are the gait
    itself."""

    def __init__(self, family: GaitFamily, options: LearningOptions) -> None:
        self.family, self.options = family, options
        joints = family.machine.model.joints
        self.columns = [joints.index(j) for leg in family.machine.legs for j in leg.joints]
        self.size, self.in_cycle = len(self.columns), family.shape.poses

    @cached_property
    def _table(self) -> tuple[Commands, Array, np.ndarray]:
        """The start; goals (P, n) [rad] and dwells [ms] of the cycle."""
        table = gait_table(self.family.machine, self.family.shape, "learned")
        units = self.family.machine.units
        goals = (table.cycle.goals - np.array([u.centre for u in units])) * np.array([u.count for u in units])
        return table.start.commands(1), goals, table.cycle.dwells_ms

    @property
    def start(self) -> Commands:
        """Commands from neutral into the gait."""
        return self._table[0]

    def commands(self, k: int, action: Array, before: Array) -> Commands:
        """Commands of one pose."""
        machine, (_, goals, dwells) = self.family.machine, self._table
        pose = k % self.in_cycle
        wanted, last = self._within(goals[pose], action), self._within(goals[pose - 1], before)
        hurry, dwell = self.family.shape.hurry, dwells[pose:pose + 1]
        return pose_table(machine, wanted[None], last[None], dwell, hurry, "learned").commands(1)

    def shape(self, mean: Array) -> GaitShape:
        """The gait with the offsets added to its angles, as far as the joints turn; its goals then lead the changed angles as the
        servo law requires."""
        shape, asked = self.family.shape, gait_table(self.family.machine, self.family.shape).asked
        rows = np.array(shape.offsets) if shape.offsets else np.zeros_like(asked)
        rows += np.array([self._within(q, action) for q, action in zip(asked, mean)]) - asked
        return GaitShape(**{**vars(shape), "offsets": tuple(tuple(float(a) for a in row) for row in rows)})

    def _within(self, goals: Array, action: Array) -> Array:
        """Angles (n,) [rad] with the offsets, as far as the joints turn, in whole counts."""
        (lower, upper), counts = self.family.machine.bounds, np.array([u.count for u in self.family.machine.units])
        lower, upper = lower + counts, upper - counts
        changed = goals.copy()
        changed[self.columns] += self.options.offset * action
        return np.clip(changed, np.minimum(goals, lower), np.maximum(goals, upper))
