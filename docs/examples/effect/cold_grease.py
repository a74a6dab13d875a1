"""Grease that has gone stiff: a joint's viscous friction is `ratio` times nominal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect, Parameter
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import ServoLaw


class ColdGrease(Effect):
    """Viscous friction `ratio` times nominal."""

    name = "cold_grease"
    layer = "actuator"
    places = ("joint",)
    family = "friction"
    parameters = (Parameter("ratio", "1", low=1.0, high=50.0, typical=3.0),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The grease of {', '.join(spec.where)} is stiff: {spec.parameters['ratio']:.1f} times the viscous friction."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (1.0,)  # at a ratio of one the effect is not there

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        viscous = law.viscous.copy()
        viscous[columns] *= values["ratio"]
        return replace(law, viscous=viscous)


EFFECT = ColdGrease()
