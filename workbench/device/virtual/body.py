"""What virtual servos move: handed in by whoever has a body; here the plainest one, joints that follow their reference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from workbench.device.virtual.clock import SECOND


@dataclass(frozen=True)
class Drive:
    """Command of a servo to its joint: enabled, goal angle [rad], speed [rad/s] (0: at once), share of full torque (0 to 1), and
    the law's margin and slope [counts] and punch [of 1023], None where the family has none."""

    enabled: bool = False
    goal: float = 0.0
    speed: float = 0.0
    torque_limit: float = 1.0
    margin: int | None = None
    slope: int | None = None
    punch: int | None = None


@dataclass(frozen=True)
class Sense:
    """State of a joint as felt by its servo: angle [rad], velocity [rad/s] and the servo's own output, -1 to 1."""

    angle: float
    velocity: float = 0.0
    duty: float = 0.0


class Body(Protocol):
    """Joints by servo (any key, the servo's own `joint`); times are the virtual clock's ticks and never run backwards."""

    def drive(self, joint: int, now: int, drive: Drive) -> None:
        """From now on the servo does this."""
        ...

    def sense(self, joint: int, now: int) -> Sense:
        """How the joint is now."""
        ...


class RampBody:
    """Joints that go to their goal at the commanded speed, without mass; a limp joint stays where it is.

    angles: where each joint starts [rad]. fastest: speed of a servo told to go at once [rad/s].
    """

    def __init__(self, angles: dict[int, float] | None = None, fastest: float = 5.7) -> None:
        self._fastest = fastest
        self._start: dict[int, float] = dict(angles or {})
        self._since: dict[int, int] = {}
        self._drive: dict[int, Drive] = {}

    def drive(self, joint: int, now: int, drive: Drive) -> None:
        """From now on the servo does this."""
        self._start[joint] = self.sense(joint, now).angle
        self._since[joint] = now
        self._drive[joint] = drive

    def sense(self, joint: int, now: int) -> Sense:
        """How the joint is now."""
        start = self._start.get(joint, 0.0)
        drive = self._drive.get(joint, Drive())
        if not drive.enabled or drive.torque_limit == 0:
            return Sense(start)
        way = drive.goal - start
        speed = min(drive.speed or self._fastest, self._fastest)
        elapsed = (now - self._since[joint]) / SECOND
        if speed * elapsed >= abs(way):
            return Sense(drive.goal)
        return Sense(start + math.copysign(speed * elapsed, way), math.copysign(speed, way), math.copysign(0.1, way))

    def turn(self, joint: int, angle: float) -> None:
        """A hand turns a limp joint to this angle [rad]."""
        self._start[joint] = angle
