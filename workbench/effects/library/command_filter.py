"""A servo filters its goals."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.effects.base import Parameter, scalar
from workbench.effects.servo_constant import ServoConstant, above_or_below, any_proportional
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel


class CommandFilter(ServoConstant):
    """A servo follows its goal through a first-order low-pass filter, as servos do that measure the width of pulses; the time
    constant is added to the nominal one."""

    name = "command_filter"
    field = "lag"
    family = "timing"
    # hobby servos are sent a pulse every 20 ms, and average a few
    parameters = (Parameter("time", "s", 0.0, 1.0, 0.01, seldom_beyond=0.06, adds_to="command_filter"),)

    def sentence(self, spec: EffectSpec) -> str:
        time, where = scalar(spec, "time"), ", ".join(spec.where)
        return f"{where} filters its goals with a time constant {1000 * abs(time):.1f} ms {above_or_below(time)} nominal."

    def could_act(self, model: RobotModel, sent: Sequence[Commands]) -> bool:
        return any_proportional(model)


EFFECT = CommandFilter()
