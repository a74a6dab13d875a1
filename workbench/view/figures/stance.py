"""When each foot is on the ground, as intervals that figures of takes on different clocks can share."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from workbench.compare.footfalls import FootPhases
from workbench.recording.take import Take
from workbench.robot import RobotModel, legs
from workbench.types import Array
from workbench.view.playback import since_start

Stance = Mapping[str, Array]
"""Foot (by its knee's joint) -> (K, 2) times of touchdown and lift-off [s] since the first command."""


def stance_of(phases: Mapping[str, FootPhases], take: Take) -> dict[str, Array]:
    """Stance of every foot, from what `foot_phases` or `force_phases` found on this take's frames."""
    clock = since_start(take)
    return {foot: intervals(clock, phase.stance) for foot, phase in phases.items()}


def unseen_of(phases: Mapping[str, FootPhases], take: Take) -> dict[str, Array]:
    """Intervals in which each foot was not seen."""
    clock = since_start(take)
    return {foot: intervals(clock, ~phase.known) for foot, phase in phases.items()}


def intervals(time: Array, on: NDArray[np.bool_]) -> Array:
    """Runs of True in `on` (N,) as (K, 2) times: from the first sample that is on to the first that is not."""
    edges = np.diff(np.concatenate([[0], np.asarray(on).astype(int), [0]]))
    begin, end = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    return np.column_stack([time[begin], time[end.clip(max=len(time) - 1)]])


def by_joint(stance: Stance, model: RobotModel) -> dict[str, Array]:
    """Joint -> stance of its leg's foot, for the joints that move only one foot."""
    return {joint: stance[foot] for foot, joints in legs(model).items() if foot in stance for joint in joints}
