"""The log that the controller's program sends over the PC link, as a joint log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workbench.device.link import LogMessage
from workbench.files import InputError
from workbench.recording.formats.joint_log import write_joint_log
from workbench.robot.mounting import JointServo


def write_telemetry(path: str | Path, messages: Sequence[LogMessage], joints: Sequence[str],
                    servos: Sequence[JointServo]) -> Path:
    """Writes the rounds of readings as a joint log, a row for the middle of each; time zero is the first row.

    joints: in the table's order, and their servos. Positions are interpolated linearly between two readings of the servo; goals
    are those of the round, whose exact times the motion itself tells. InputError where there are fewer than two rounds, or of
    another number of joints.
    """
    rounds = [m for m in messages if len(m.goals) == len(joints)]
    if len(rounds) < 2:
        raise InputError(None, f"{len(rounds)} rounds of {len(joints)} joints in the controller's log; expected two or more")
    begin = np.array([m.time for m in rounds])
    took = np.array([m.duration for m in rounds])
    time = begin + took / 2
    channels = {}
    for k, (joint, servo) in enumerate(zip(joints, servos)):
        channels[f"goal.{joint}"] = np.array([servo.angle(m.goals[k]) for m in rounds])
        answered = np.array([m.positions[k] is not None for m in rounds])
        if not answered.any():
            raise InputError(None, f"joint {joint} never answered in the controller's log")
        read = (begin + took * (k + 0.5) / len(joints))[answered]
        angle = np.array([servo.angle(p) for m in rounds if (p := m.positions[k]) is not None])
        channels[f"position.{joint}"] = np.interp(time, read, angle, left=np.nan, right=np.nan)
    channels["voltage"] = np.array([m.battery for m in rounds])
    return write_joint_log(path, time - time[0], channels)
