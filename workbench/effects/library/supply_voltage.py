"""The supply is not at its nominal voltage: every servo has that share of its stall torque and no-load speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect, Parameter, Registers, mean_of_logs
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import ServoLaw

STANDS = 1.5
"""Largest supply voltage, over the voltage at which a servo is rated or said to run: a full pack of two cells on
a servo rated at 6 V is 1.4; more burns it."""
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
        return f"The servos see {spec.parameters['voltage']:.1f} V."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (float(np.mean([model.servo(j).supply_voltage for j in model.joints])),)

    def reach(self, sdf: SdfRobot, model: RobotModel, where: tuple[str, ...]) -> float:
        (nominal,) = self.neutral(model)
        return STANDS * max(nominal, *(model.servo(j).rated_voltage for j in model.joints)) - nominal

    def in_registers(self, logs: Sequence[Registers], where: tuple[str, ...]) -> tuple[float, float] | None:
        """The median that servos measured in each log, to the resolution of their registers."""
        seen = [log.voltage[np.isfinite(log.voltage)] for log in logs if log.voltage is not None]
        return mean_of_logs([float(np.median(v)) for v in seen if len(v)], REGISTER)

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        return replace(law, full_torque=law.torque_per_volt * values["voltage"])


EFFECT = SupplyVoltage()
