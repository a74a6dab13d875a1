"""A servo rests within a wider margin around its goal than nominal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import DEGREE, Effect, Parameter
from workbench.robot import EffectSpec
from workbench.servo import ServoLaw


class DeadBand(Effect):
    """A servo rests within a wider margin around its goal than nominal."""

    name = "dead_band"
    layer = "actuator"
    places = ("joint",)
    parameters = (Parameter("margin", "deg", 0.0, 15.0, 0.5, si=DEGREE),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} gives no torque within {spec.parameters['margin']:.1f} deg more of its goal, each side."

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        margin = law.margin.copy()
        margin[columns] += values["margin"]
        return replace(law, margin=margin)


EFFECT = DeadBand()
