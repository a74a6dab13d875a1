"""Outside its dead zone, a servo starts with more duty than nominal, or less."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.effects.base import Parameter, scalar
from workbench.effects.servo_constant import ServoConstant, above_or_below, any_proportional
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel


class MinimumDuty(ServoConstant):
    """The duty at the edge of a servo's dead zone is larger than nominal by `duty` (smaller if that is negative), and so is all
    duty beyond it, as set by a register for start-up force or punch."""

    name = "minimum_duty"
    field = "punch"
    # the AX-12A's default punch is 3 % of full duty, the STS3215's 1.5 %
    parameters = (Parameter("duty", "1", 0.0, 0.5, 0.02, seldom_beyond=0.1, adds_to="punch_duty"),)

    def sentence(self, spec: EffectSpec) -> str:
        share, where = 100 * scalar(spec, "duty"), ", ".join(spec.where)
        return f"The smallest duty of {where} is {above_or_below(share)} nominal by {abs(share):.1f} % of full duty."

    def could_act(self, model: RobotModel, sent: Sequence[Commands]) -> bool:
        return any_proportional(model)


EFFECT = MinimumDuty()
