"""Effects that change one constant of a servo's law by their first parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect
from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.robot import RobotModel
from workbench.robot.servo_profile_file import servo_profile
from workbench.servo import ServoLaw


class ServoConstant(Effect):
    """The first parameter is added to a field of `ServoLaw`, which stays non-negative, multiplies it, or limits it from above."""

    layer = "actuator"
    places = ("joint",)
    field: ClassVar[str]
    how: ClassVar[Literal["add", "multiply", "at most"]] = "add"

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        """Changes the constant at the effect's joints only."""
        constant, by = getattr(law, self.field).copy(), values[self.parameters[0].name]
        before = constant[columns]
        after = {"add": np.maximum(before + by, 0.0), "multiply": before * by, "at most": np.minimum(before, by)}
        constant[columns] = after[self.how]
        return replace(law, **{self.field: constant})


def more_or_less(value: float) -> str:
    """"more", or "less" for a negative value."""
    return "less" if value < 0 else "more"


def above_or_below(value: float) -> str:
    """"above", or "below" for a negative value."""
    return "below" if value < 0 else "above"


def any_proportional(model: RobotModel) -> bool:
    """Whether a servo of the robot has a proportional position gain."""
    return any(model.servo(j).proportional_gain is not None for j in model.joints)


def any_at_once(sent: Sequence[Commands]) -> bool:
    """Whether a goal comes without a moving speed."""
    return any(bool((c.speeds <= 0).any()) for c in sent)


def any_register(model: RobotModel, name: str) -> bool:
    """Whether a servo of the robot is of a known family that has a register of this name."""
    return any(name in _registers(model.servo(j).model) for j in model.joints)


def _registers(family: str) -> Sequence[str]:
    try:
        return tuple(servo_profile(family).registers)
    except InputError:  # no known family
        return ()
