"""Goal position and moving speed in a servo family's own counts: the units of a motion table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from workbench.files import InputError
from workbench.robot.model import RobotModel
from workbench.robot.servo_constants import COUNT, SPEED_UNIT
from workbench.robot.servo_profile import ServoProfile
from workbench.robot.servo_profile_file import servo_profile


@dataclass(frozen=True)
class ServoUnits:
    """The counts of one family; the defaults are the AX-12A's (the same as in data/servos/ax12a.yaml).

    family: its name. count: one count of position [rad]; centre: the position of angle zero; highest: the largest goal of a joint
    that turns less than once. speed_unit: one count of moving speed [rad/s]; fastest: the largest count of it; table_unit: value
    that a motion table's conversion assumes for a count of moving speed [rad/s] (the thesis: 114/1023 rpm, where the servo has
    0.111).
    """

    family: str = "AX-12A"
    count: float = COUNT
    centre: int = 512
    highest: int = 1023
    speed_unit: float = SPEED_UNIT
    fastest: int = 1023
    table_unit: float = math.radians(114 / 1023 * 6)

    @staticmethod
    def of(profile: ServoProfile) -> ServoUnits:
        """The counts of a family."""
        return ServoUnits(profile.name, profile.count, profile.centre, profile.largest_position, profile.speed_unit,
                          profile.largest_speed, profile.table_unit or profile.speed_unit)

    def __str__(self) -> str:
        return (f"{self.family}: goal positions 0 to {self.highest}, {math.degrees(self.count):.4g} deg each, {self.centre} = "
                f"neutral; moving speeds {math.degrees(self.speed_unit) / 6:.4g} rpm each, 0 = at once")


AX12A = ServoUnits()


def units_of(model: RobotModel, joints: Sequence[str]) -> tuple[ServoUnits, ...]:
    """The counts of each joint's servo, by the profile of its family; the AX-12A's where nobody knows the family."""
    return tuple(_units(model.servo(joint).model) for joint in joints)


def known_units(model: RobotModel, joints: Sequence[str]) -> tuple[ServoUnits, ...]:
    """The same as `units_of`, for goals that reach a real servo; InputError for an unknown family, as the counts of another would
    turn its joint to another angle."""
    for joint in joints:
        reason = unknown_family(model.servo(joint).model)
        if reason:
            raise InputError(model.description, f"joint {joint}: {reason}")
    return units_of(model, joints)


def unknown_family(model: str) -> str:
    """Why nothing can be sent to a servo of this name; "" if its family is known."""
    try:
        servo_profile(model)
    except InputError as e:
        return e.problem
    return ""


def maker_of(model: str) -> str:
    """The manufacturer of a servo; "" if unknown."""
    return "" if unknown_family(model) else servo_profile(model).maker


def _units(model: str) -> ServoUnits:
    try:
        return ServoUnits.of(servo_profile(model))
    except InputError:
        return AX12A
