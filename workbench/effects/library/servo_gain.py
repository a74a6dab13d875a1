"""A servo's position gain (duty per error) is higher or lower than nominal; punch unchanged."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.effects.base import Parameter
from workbench.effects.registers import Registers, mean_of_logs
from workbench.effects.servo_constant import ServoConstant
from workbench.robot import EffectSpec, RobotModel

LEAST_DUTY, MOST_DUTY = 0.05, 0.9
"""Range of duty in which the gain can be measured: below it, counts of position are too coarse; above it, duty may saturate."""
COUNTS = 0.01
"""Least standard error of a duty register, which is read some milliseconds before or after the position."""


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

    def in_registers(self, logs: Sequence[Registers], where: tuple[str, ...]) -> tuple[float, float] | None:
        """Ratio of the duty register to the duty of the nominal law at the logged error."""
        ratios = []
        for log in logs:
            for joint in where:
                if joint not in log.duty or joint not in log.nominal_duty:
                    continue
                duty, nominal = log.duty[joint], log.nominal_duty[joint]
                good = np.isfinite(duty) & np.isfinite(nominal) & (np.abs(nominal) > LEAST_DUTY) & (np.abs(nominal) < MOST_DUTY)
                if good.sum() > 50:
                    ratios.append(float(duty[good] @ nominal[good] / (nominal[good] @ nominal[good])))
        return mean_of_logs(ratios, COUNTS)


EFFECT = ServoGain()
