"""A weak supply: its voltage drops with the total current of all servos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.effects.base import Effect, Parameter, scalar
from workbench.effects.registers import Registers, mean_of_logs
from workbench.robot import EffectSpec
from workbench.servo import Instant, ServoLaw, ServoTerm, TermNumbers
from workbench.types import Array, Mask

LEAST_DRAWN = 0.3
"""Least change of the summed duties for a log's voltage to determine a sag."""
COUNT = 0.05
"""Least standard error [V] of a voltage register: half of its steps of 0.1 V."""


@dataclass(frozen=True)
class _Sagging(ServoTerm):
    """drop [V] for each servo at full duty."""

    drop: float

    def strength(self, law: ServoLaw, now: Instant) -> Array:
        supply = law.full_torque / law.torque_per_volt
        return np.asarray(np.maximum(1.0 - self.drop * np.abs(now.duty).sum() / supply, 0.0))

    def numbers(self) -> TermNumbers:
        return TermNumbers(sag=self.drop)


class SupplySag(Effect):
    """The supply's voltage drops in proportion to the summed duties of the servos, by the same amount for every servo."""

    name = "supply_sag"
    layer = "actuator"
    places = ("robot",)
    family = "electrical"
    tied = "less torque at full duty"
    under_load = True
    parameters = (Parameter("drop", "V", 0.0, 5.0, 0.3),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The supply drops by {scalar(spec, 'drop'):.2f} V for each servo at full duty."

    def in_registers(self, logs: Sequence[Registers], where: tuple[str, ...]) -> tuple[float, float] | None:
        """The slope of the voltage register over the sum of the servos' duties."""
        drops = []
        for log in logs:
            if log.voltage is None or not log.duty:
                continue
            drawn = np.abs(np.column_stack(list(log.duty.values()))).sum(axis=1)
            good = np.isfinite(drawn) & np.isfinite(log.voltage)
            if good.any() and np.ptp(drawn[good]) > LEAST_DRAWN:
                drops.append(-float(np.polyfit(drawn[good], log.voltage[good], 1)[0]))
        return mean_of_logs(drops, COUNT)

    def servo_term(self, here: Mask, values: Mapping[str, float]) -> ServoTerm:
        return _Sagging(values["drop"])


EFFECT = SupplySag()
