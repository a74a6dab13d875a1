"""Pose tables in the servos' own counts, where a servo does not have its joint's angle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from workbench.motion import PoseTable
from workbench.robot.mounting import Mounting


def zeros(table: PoseTable, mountings: Mapping[str, Mounting]) -> list[int]:
    """Count at which each joint of the table is at zero."""
    return [mountings.get(joint, Mounting()).zero_count(units.centre, units.count)
            for joint, units in zip(table.joints, table.units)]


def in_servo_counts(table: PoseTable, mountings: Mapping[str, Mounting]) -> PoseTable:
    """The table with the goals as the servos' registers hold them; InputError names pose and joint of one that does not fit."""
    if not mountings:
        return table
    signs = np.array([mountings.get(joint, Mounting()).direction for joint in table.joints])
    centres = np.array([units.centre for units in table.units])
    return replace(table, goals=np.array(zeros(table, mountings)) + signs * (table.goals - centres))


def in_joint_counts(table: PoseTable, mountings: Mapping[str, Mounting]) -> PoseTable:
    """The inverse of `in_servo_counts`."""
    signs = np.array([mountings.get(joint, Mounting()).direction for joint in table.joints])
    centres = np.array([units.centre for units in table.units])
    return replace(table, goals=centres + signs * (table.goals - np.array(zeros(table, mountings))))
