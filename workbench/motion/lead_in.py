"""The way from neutral to a motion's first pose, and what a moving speed of 0 may stand for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from workbench.motion.commands import Commands
from workbench.types import Array

SLOW = 0.6
"""Speed of the fastest joint on a way that no table paces [rad/s]: a tenth of what an AX-12A can do."""


def paced(commands: Commands, count: Array, speed_unit: Array, slow: float = SLOW) -> Commands:
    """The same commands, from neutral, in which no joint that has to move is told to move at once (speed 0).

    Such a joint gets the speed that brings it there within the dwell; a speed is rounded up to whole counts, speed_unit (n,)
    [rad/s]. Where one would have to be faster than `slow` [rad/s] for the very first pose, a command is put in front that takes
    all joints there first, the farthest at `slow`, and all else comes later by as much. A way of at most a count of position,
    count (n,) [rad], is none. A joint whose torque is off, or comes on with the command, is left as it is.
    """
    before = np.vstack([np.zeros(len(commands.joints)), commands.goals[:-1]])
    on = commands.enabled & np.vstack([commands.enabled[:1], commands.enabled[:-1]])
    way = np.where(on, np.abs(commands.goals - before), 0.0)
    at_once = (commands.speeds == 0) & (way > 1.01 * count)
    if not at_once.any():
        return commands
    dwell = np.diff(np.append(commands.times, commands.end))[:, None]
    needed = np.ceil(way / np.maximum(dwell, 1e-3) / speed_unit - 1e-6) * speed_unit
    first = at_once[0] & (needed[0] > slow)
    speeds = np.where(at_once, needed, commands.speeds)
    if not first.any():
        return replace(commands, speeds=speeds)
    lead = math.ceil(1000 * float(way[0].max()) / slow) / 1000
    ways = np.maximum(np.ceil(way[:1] / lead / speed_unit), 1) * speed_unit
    speeds[0] = commands.speeds[0]  # it is there by then
    return Commands(
        np.concatenate([[0.0], commands.times + lead]), commands.joints, np.vstack([commands.goals[:1], commands.goals]),
        np.vstack([ways, speeds]), np.vstack([commands.enabled[:1], commands.enabled]), commands.end + lead,
        np.concatenate([[-1], commands.poses]))
