"""A servo moves its internal reference to the goal at a limited speed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from workbench.effects.base import DEGREE, Parameter, scalar
from workbench.effects.servo_constant import ServoConstant, any_at_once, any_proportional
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel


class GoalRamp(ServoConstant):
    """A servo moves its internal reference to the goal at no more than `speed`, or at the moving speed or the nominal ramp if
    these are slower. Goals that move more slowly than that are not affected."""

    name = "goal_ramp"
    field = "ramp"
    how = "at most"
    family = "timing"
    parameters = (Parameter("speed", "deg/s", 1.0, 1e5, 300.0, si=DEGREE),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} moves its internal reference at no more than {scalar(spec, 'speed'):.0f} deg/s."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (math.inf,)

    def could_act(self, model: RobotModel, sent: Sequence[Commands]) -> bool:
        return any_proportional(model) and any_at_once(sent)


EFFECT = GoalRamp()
