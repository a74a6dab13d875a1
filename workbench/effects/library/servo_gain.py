"""A servo's law is steeper or flatter than nominal (duty per error); punch unchanged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect, Parameter
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import ServoLaw


class ServoGain(Effect):
    """A servo's law is steeper or flatter than nominal (duty per error); punch unchanged."""

    name = "servo_gain"
    layer = "actuator"
    places = ("joint",)
    family = "electrical"
    parameters = (Parameter("ratio", "1", 0.05, 5.0, 0.8),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The position law of {', '.join(spec.where)} is {spec.parameters['ratio']:.2f} times as steep as nominal."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (1.0,)

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        gain = law.gain.copy()
        gain[columns] *= values["ratio"]
        return replace(law, gain=gain)


EFFECT = ServoGain()
