"""A servo's position gain (duty per error) is higher or lower than nominal; punch unchanged."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.effects.base import Parameter, Registers
from workbench.effects.servo_constant import ServoConstant
from workbench.robot import EffectSpec, RobotModel


class ServoGain(ServoConstant):
    """The position gain (duty per error) is higher or lower than nominal; punch unchanged."""

    name = "servo_gain"
    field = "gain"
    how = "multiply"
    family = "electrical"
    estimator = "gain in a register of duty"
    # gain registers have steps of powers of two, like the AX-12A's compliance slope: one step
    parameters = (Parameter("ratio", "1", 0.05, 5.0, 0.8, seldom_beyond=2.0),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The position gain of {', '.join(spec.where)} is {spec.parameters['ratio']:.2f} times nominal."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (1.0,)

    def in_registers(self, logs: Sequence[Registers], where: tuple[str, ...]) -> tuple[float, float] | None:
        """The gain that the register of duty shows, as the servo's law read from all logs has it."""
        return next((log.gain[joint] for log in logs for joint in where if joint in log.gain), None)


EFFECT = ServoGain()
