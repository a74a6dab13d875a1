"""A motor's torque is limited: by the driver's current limit, by heat, or because it is another servo of the family."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.effects.base import Effect, Parameter, scalar
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import ServoTerm, TermNumbers
from workbench.types import Array, Mask


@dataclass(frozen=True)
class _Ceiling(ServoTerm):
    """most: (n,) [N m]."""

    most: Array

    def ceiling(self) -> Array:
        return self.most

    def numbers(self) -> TermNumbers:
        return TermNumbers(ceiling=self.most)


class TorqueCeiling(Effect):
    """The motor's torque (duty torque minus back-EMF) is limited: by the driver's current limit, by heat, or
    because the servo is of another model."""

    name = "torque_ceiling"
    layer = "actuator"
    places = ("joint",)
    family = "electrical"
    tied = "less torque at full duty"
    under_load = True
    parameters = (Parameter("torque", "N m", 0.005, 10.0, 0.4),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The motor torque of {', '.join(spec.where)} is limited to {scalar(spec, 'torque'):.2f} N m."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (math.inf,)

    def servo_term(self, here: Mask, values: Mapping[str, float]) -> ServoTerm:
        return _Ceiling(np.where(here, values["torque"], np.inf))


EFFECT = TorqueCeiling()
