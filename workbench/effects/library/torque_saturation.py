"""A motor's torque grows less than in proportion to its duty: a drop in the H-bridge, magnetic saturation, a weak driver."""

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
class _Saturating(ServoTerm):
    """torque: (n,) [N m]."""

    torque: Array

    def saturation(self) -> Array:
        return self.torque

    def numbers(self) -> TermNumbers:
        return TermNumbers(bend=1.0 / self.torque)


class TorqueSaturation(Effect):
    """The motor's torque x (duty torque minus back-EMF) acts as x / (1 + |x|/torque): almost unchanged while it is small, halved
    at `torque`, and never above `torque`. Unlike a ceiling, it is smooth."""

    name = "torque_saturation"
    layer = "actuator"
    places = ("joint",)
    family = "electrical"
    tied = "less torque at full duty"
    under_load = True
    parameters = (Parameter("torque", "N m", 0.02, 1e8, 1.0),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The motor of {', '.join(spec.where)} saturates: a torque of {scalar(spec, 'torque'):.2f} N m is halved."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (math.inf,)

    def servo_term(self, here: Mask, values: Mapping[str, float]) -> ServoTerm:
        return _Saturating(np.where(here, values["torque"], np.inf))


EFFECT = TorqueSaturation()
