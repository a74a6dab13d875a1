"""A servo whose controller has a derivative gain."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.effects.base import Parameter, scalar
from workbench.effects.servo_constant import ServoConstant, any_register
from workbench.motion.commands import Commands
from workbench.robot import EffectSpec, RobotModel


class DampingGain(ServoConstant):
    """A servo's duty is reduced by `gain` times the speed of its joint, beyond nominal: viscous friction made by the motor, which
    is lost where duty saturates and while torque is off."""

    name = "damping_gain"
    field = "derivative"
    family = "friction"
    parameters = (Parameter("gain", "s/rad", 0.0, 10.0, 0.02),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} has a derivative gain of {scalar(spec, 'gain'):.4f} duty per rad/s beyond nominal."

    def could_act(self, model: RobotModel, sent: Sequence[Commands]) -> bool:
        return any_register(model, "position_d_gain")


EFFECT = DampingGain()
