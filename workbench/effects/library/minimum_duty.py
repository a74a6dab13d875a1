"""Outside its dead zone, a servo starts with more duty than nominal."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.effects.base import Parameter, scalar
from workbench.effects.servo_constant import ServoConstant, any_proportional
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel


class MinimumDuty(ServoConstant):
    """The duty at the edge of a servo's dead zone is larger than nominal by `duty`, and so is all duty beyond it, as set
    by a register for start-up force or punch."""

    name = "minimum_duty"
    field = "punch"
    # the AX-12A's default punch is 3 % of full duty, the STS3215's 1.5 %
    parameters = (Parameter("duty", "1", 0.0, 0.5, 0.02, seldom_beyond=0.1),)

    def sentence(self, spec: EffectSpec) -> str:
        share = 100 * scalar(spec, "duty")
        return f"The smallest duty of {', '.join(spec.where)} is above nominal by {share:.1f} % of full duty."

    def could_act(self, model: RobotModel, sent: Sequence[Commands]) -> bool:
        return any_proportional(model)


EFFECT = MinimumDuty()
