"""How servos are mounted on their joints: their direction, and their angle when the joint's is zero."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from workbench.files import InputError
from workbench.files.reading import read_text
from workbench.files.yaml_file import Fields
from workbench.robot.names import HIGHEST_BUS_ID
from workbench.robot.servo_profile import ServoProfile

LEROBOT = {"id", "drive_mode", "homing_offset", "range_min", "range_max"}
"""Keys of one motor in LeRobot's calibration file."""


@dataclass(frozen=True)
class Mounting:
    """How one servo is mounted on its joint: the servo's angle from its centre is direction * (the joint's angle) + offset.

    direction: 1, or -1 for a servo that turns against the joint's axis. offset [rad], rounded to whole counts. zero: position in
    counts at which the joint is at zero; None: given by the offset. homing: expected content of the servo's register
    homing_offset, None where it does not matter.
    """

    direction: int = 1
    offset: float = 0.0
    zero: float | None = None
    homing: int | None = None

    @property
    def plain(self) -> bool:
        """Whether joint and servo have the same angle."""
        return self == Mounting()

    def zero_count(self, centre: int, count: float) -> int:
        """Position [counts] at which the joint is at zero. centre: that of the servo's angle zero. count: one count [rad]."""
        return round(self.zero) if self.zero is not None else centre + round(self.offset / count)


@dataclass(frozen=True)
class JointServo:
    """Converts between a joint's angle and its servo's position register."""

    profile: ServoProfile
    mounting: Mounting = field(default_factory=Mounting)

    @property
    def zero(self) -> int:
        """Position in counts at which the joint is at zero."""
        return self.mounting.zero_count(self.profile.centre, self.profile.count)

    def angle(self, position: float) -> float:
        """The joint's angle [rad] at a position in counts."""
        return self.mounting.direction * (position - self.zero) * self.profile.count

    def position(self, angle: float) -> int:
        """The count nearest to a joint's angle [rad], halves away from zero; InputError where the register cannot hold it."""
        steps = angle / self.profile.count
        nearest = int(math.copysign(math.floor(abs(steps) + 0.5 + 1e-9), steps))
        position = self.zero + self.mounting.direction * nearest
        if not 0 <= position <= self.profile.largest_position:
            raise InputError(self.profile.name, f"{math.degrees(angle):.1f} deg is count {position}; expected 0 to "
                                                f"{self.profile.largest_position}")
        return position

    def limits(self, lower: float, upper: float) -> tuple[int, int]:
        """Lowest and highest position of a joint that turns from `lower` to `upper` [rad], within the register's range."""
        ends = sorted((self._limit(lower), self._limit(upper)))
        return ends[0], ends[1]

    def to_servo(self, angle: float) -> float:
        """The servo's angle from its centre [rad] at an angle of the joint."""
        return self.mounting.direction * angle + (self.zero - self.profile.centre) * self.profile.count

    def from_servo(self, angle: float) -> float:
        """The joint's angle [rad] at an angle of the servo from its centre."""
        return self.mounting.direction * (angle - (self.zero - self.profile.centre) * self.profile.count)

    @property
    def range(self) -> tuple[float, float]:
        """The joint's angles [rad] at the ends of the servo's range, the lower one first."""
        ends = sorted((self.angle(0), self.angle(self.profile.largest_position)))
        return ends[0], ends[1]

    def _limit(self, angle: float) -> int:
        most = self.profile.largest_position
        if math.isinf(angle):
            return 0 if angle * self.mounting.direction < 0 else most
        return min(max(self.zero + self.mounting.direction * round(angle / self.profile.count), 0), most)


def read_mountings(f: Fields, joints: tuple[str, ...]) -> dict[str, Mounting]:
    """The keys `direction` (1 or -1), `offset` [deg] and `homing` [counts] of a `robot` section, each by joint; a joint that none
    of them names is left out."""
    out: dict[str, Mounting] = {}
    for place, joint, value in _by_joint(f, "direction", joints):
        if isinstance(value, bool) or value not in (1, -1):
            raise place.error(joint, f"expected 1 or -1, got {value!r}")
        out[joint] = Mounting(int(value))
    for place, joint, value in _by_joint(f, "offset", joints):
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= 360:
            raise place.error(joint, f"expected degrees from -360 to 360, got {value!r}")
        out[joint] = replace(out.get(joint, Mounting()), offset=math.radians(value))
    for place, joint, value in _by_joint(f, "homing", joints):
        if isinstance(value, bool) or not isinstance(value, int):
            raise place.error(joint, f"expected a whole number of counts, got {value!r}")
        out[joint] = replace(out.get(joint, Mounting()), homing=value)
    return {joint: m for joint, m in out.items() if not m.plain}


def _by_joint(f: Fields, key: str, joints: tuple[str, ...]) -> list[tuple[Fields, str, Any]]:
    """The mapping at a key, joint and value, each joint one of the model's."""
    given = f.mapping(key)
    if given is None:
        return []
    entries = [(given, joint, value) for joint, value in given.items()]
    for place, joint, _ in entries:
        if joint not in joints:
            raise place.error(joint, f"the model has no joint '{joint}'; expected one of {', '.join(joints)}")
    return entries


def written_mountings(mountings: Mapping[str, Mounting], profiles: Mapping[str, ServoProfile]) -> dict[str, dict[str, float]]:
    """The content that `read_mountings` reads back; empty keys are omitted."""
    content: dict[str, dict[str, float]] = {"direction": {}, "offset": {}, "homing": {}}
    for joint, m in mountings.items():
        offset = m.offset
        if m.zero is not None:
            offset = (m.zero - profiles[joint].centre) * profiles[joint].count
        if m.direction != 1:
            content["direction"][joint] = m.direction
        if offset:
            content["offset"][joint] = math.degrees(offset)
        if m.homing is not None:
            content["homing"][joint] = m.homing
    return {key: values for key, values in content.items() if values}


def read_lerobot(path: str | Path, joints: tuple[str, ...]) -> tuple[dict[str, int], dict[str, Mounting]]:
    """Bus IDs and mountings from a calibration file of LeRobot, whose motors are named like the model's joints.

    Zero is the middle between range_min and range_max, as it is for LeRobot's own degrees; with drive_mode 1 the servo turns
    against the joint. InputError names the motor and its expected values.
    """
    try:
        content = json.loads(read_text(path))
    except ValueError as e:
        raise InputError(path, f"not JSON ({e})") from None
    if not isinstance(content, dict) or not content:
        raise InputError(path, "expected the calibration that LeRobot writes: motors by name")
    ids: dict[str, int] = {}
    mountings: dict[str, Mounting] = {}
    for motor, values in content.items():
        if motor not in joints:
            raise InputError(path, f"motor {motor}: the model has no such joint; its joints: {' '.join(joints)}")
        good = isinstance(values, dict) and set(values) >= LEROBOT
        if not good or not all(isinstance(values[k], int) and not isinstance(values[k], bool) for k in LEROBOT):
            raise InputError(path, f"motor {motor}: expected whole numbers for {', '.join(sorted(LEROBOT))}")
        number, mode, low, high = (values[k] for k in ("id", "drive_mode", "range_min", "range_max"))
        if not low < high or mode not in (0, 1) or not 0 <= number <= HIGHEST_BUS_ID or number in ids.values():
            raise InputError(path, f"motor {motor}: expected range_min below range_max, drive_mode 0 or 1, and an id of its own, "
                                   f"at most {HIGHEST_BUS_ID}; got {low}, {high}, {mode}, {number}")
        ids[motor] = number
        mountings[motor] = Mounting(-1 if mode else 1, zero=(low + high) / 2, homing=values["homing_offset"])
    return ids, mountings
