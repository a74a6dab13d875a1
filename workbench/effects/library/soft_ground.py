"""The floor, or the rubber of the feet, is soft."""

from __future__ import annotations

import math
from collections.abc import Mapping

from workbench.effects.base import Effect, Parameter
from workbench.physical import GROUND
from workbench.robot import EffectSpec, RobotModel


class SoftGround(Effect):
    """The floor, or the rubber of the feet, is soft."""

    name = "soft_ground"
    layer = "ground"
    places = ("robot",)
    observable_when_fixed = False
    parameters = (Parameter("stiffness", "N/m", GROUND["stiffness"].low, 1e7, 5e3),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"Each contact point of a foot has a stiffness of {spec.parameters['stiffness']:.0f} N/m."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (math.inf,)

    def foot_stiffness(self, values: Mapping[str, float]) -> float:
        return values["stiffness"]


EFFECT = SoftGround()
