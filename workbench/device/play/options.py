"""How a motion is played, and how it went."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class PlayOptions:
    """How a motion is played.

    ramp_speed: of the fastest joint on the way to neutral [rad/s], a tenth of the speed of an AX-12. step: between the goals of
    a ramp [s]. arrive: largest distance of a joint from its goal at the end [rad], beyond its droop under the robot's weight;
    within: longest time beyond the ramp [s]. seat: largest offset beyond neutral that a joint is sent, so that it reaches neutral
    before it is let down onto its droop [rad]; seat_seconds: time for that, and then to come to rest [s].
    rest: time in neutral before the first pose and after the last [s]; a recording needs half a second of it.
    watchdog: silence after which servos with a watchdog stop [s]. start_torque: share of the torque limit on the first way to
    neutral, so that a joint that is caught somewhere is not torn off. torque: the same for the motion. hold: torque stays on at
    the end.
    """

    ramp_speed: float = 0.6
    step: float = 0.02
    arrive: float = math.radians(12)
    within: float = 1.0
    seat: float = math.radians(4)
    seat_seconds: float = 0.3
    rest: float = 1.0
    watchdog: float = 0.5
    start_torque: float = 0.5
    torque: float = 1.0
    hold: bool = False


@dataclass(frozen=True)
class Played:
    """How it went. started: when the first pose was sent, ended: when the last one's dwell was over or the motion was stopped,
    on the bus's clock [s]. worst_late: by which a pose was late [s]. stopped: why it ended early, "" where it did not. released:
    whether torque is off. unknown: joints that did not confirm it when they were asked. rates: readings of each joint in the
    motion, a second. repaired: goals that did not arrive and were sent again. missed: goals known not to have arrived in time,
    and poses sent with less than a tenth of their time left. log_problem: why there is no joint log, "" where there is one.
    log_start: time zero of the log, on the bus's clock [s]: when it came to rest in neutral or, if it never did, when its first
    goal was sent; NaN where there was none."""

    journal: Path
    started: float
    ended: float
    poses: int
    worst_late: float
    stopped: str
    released: bool
    unknown: tuple[str, ...] = ()
    rates: Mapping[str, float] = field(default_factory=dict)
    repaired: int = 0
    missed: int = 0
    log_problem: str = ""
    log_start: float = math.nan
