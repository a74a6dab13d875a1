"""The approach from neutral to a motion's first pose, and the replacement of moving speed 0."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from workbench.motion.commands import Commands
from workbench.types import Array

SLOW = 0.6
"""Speed of the fastest joint where no table sets one [rad/s]: a tenth of the speed of an AX-12A."""


def pace(commands: Commands, count: Array, speed_unit: Array) -> Commands:
    """The same commands, from neutral, in which no joint that has to move is sent speed 0 (at once).

    Such a joint gets the speed that brings it there within the dwell; a speed is rounded up to whole counts, speed_unit (n,)
    [rad/s]. Where one would have to be faster than SLOW for the very first pose, a command is inserted before it that takes every
    joint there first, the farthest at SLOW, and everything else is delayed by as much. A distance of at most a
    count of position, count (n,) [rad], is ignored. A joint whose torque is off, or comes on with the command, is left as it is.
    """
    before = np.vstack([np.zeros(len(commands.joints)), commands.goals[:-1]])
    on = commands.enabled & np.vstack([commands.enabled[:1], commands.enabled[:-1]])
    way = np.where(on, np.abs(commands.goals - before), 0.0)
    at_once = (commands.speeds == 0) & (way > 1.01 * count)
    if not at_once.any():
        return commands
    dwell = np.diff(np.append(commands.times, commands.end))[:, None]
    needed = np.ceil(way / np.maximum(dwell, 1e-3) / speed_unit - 1e-6) * speed_unit
    first = at_once[0] & (needed[0] > SLOW)
    speeds = np.where(at_once, needed, commands.speeds)
    if not first.any():
        return replace(commands, speeds=speeds)
    lead = math.ceil(1000 * float(way[0].max()) / SLOW) / 1000
    ways = np.maximum(np.ceil(way[:1] / lead / speed_unit), 1) * speed_unit
    speeds[0] = commands.speeds[0]  # it is there by then
    return Commands(
        np.concatenate([[0.0], commands.times + lead]), commands.joints, np.vstack([commands.goals[:1], commands.goals]),
        np.vstack([ways, speeds]), np.vstack([commands.enabled[:1], commands.enabled]), commands.end + lead,
        np.concatenate([[-1], commands.poses]))
