"""A servo's position gain (duty per error) is higher or lower than nominal; punch unchanged."""

from __future__ import annotations

from workbench.effects.base import Parameter
from workbench.effects.servo_constant import ServoConstant
from workbench.recording.servo_log.duty_register import RegisterLaw
from workbench.robot import EffectSpec, RobotModel, ServoConstants

LAW_ERROR = 0.03
"""Standard error of a gain read from duty, as a share: the law behind it is an approximation, and twelve sessions of
one STS3215 gave gains up to 2 % off."""


class ServoGain(ServoConstant):
    """The position gain (duty per error) is higher or lower than nominal; punch unchanged."""

    name = "servo_gain"
    field = "gain"
    how = "multiply"
    family = "electrical"
    # gain registers have steps of powers of two, like the AX-12A's compliance slope: one step
    parameters = (Parameter("ratio", "1", 0.05, 5.0, 0.8, seldom_beyond=2.0),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The position gain of {', '.join(spec.where)} is {spec.parameters['ratio']:.2f} times nominal."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (1.0,)

    def in_duty(self, law: RegisterLaw, servo: ServoConstants) -> tuple[float, float] | None:
        return law.gain, max(law.sd["gain"], LAW_ERROR * law.gain)



EFFECT = ServoGain()
