"""The supply is not at its nominal voltage: stall torque and no-load speed of every servo change in proportion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect, Parameter
from workbench.effects.registers import Registers, mean_of_logs
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import ServoLaw

STANDS = 1.5
"""Largest supply voltage relative to a servo's rated or nominal one: 1.4 for a fully charged battery of two cells on a servo
rated at 6 V; more would burn it."""
REGISTER = 0.1
"""Resolution of the voltage that servos measure [V]."""


class SupplyVoltage(Effect):
    """The supply is not at its nominal voltage: stall torque and no-load speed of every servo change in proportion."""

    name = "supply_voltage"
    layer = "actuator"
    places = ("robot",)
    family = "electrical"
    tied = "gravity against torque"
    parameters = (Parameter("voltage", "V", 3.0, 20.0, 10.0, replaces=True),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The supply voltage at the servos is {spec.parameters['voltage']:.1f} V."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (float(np.mean([model.servo(j).supply_voltage for j in model.joints])),)

    def reach(self, sdf: SdfRobot, model: RobotModel, where: tuple[str, ...]) -> float:
        (nominal,) = self.neutral(model)
        return STANDS * max(nominal, *(model.servo(j).rated_voltage for j in model.joints)) - nominal

    def in_registers(self, logs: Sequence[Registers], where: tuple[str, ...]) -> tuple[float, float] | None:
        """The median of the voltage measured by the servos, for each log, to the resolution of their registers."""
        seen = [log.voltage[np.isfinite(log.voltage)] for log in logs if log.voltage is not None]
        return mean_of_logs([float(np.median(v)) for v in seen if len(v)], REGISTER)

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        return replace(law, full_torque=law.torque_per_volt * values["voltage"])


EFFECT = SupplyVoltage()
