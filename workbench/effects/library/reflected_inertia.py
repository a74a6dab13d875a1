"""Rotor and gear weigh more at the joint than nominal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect, Parameter
from workbench.robot import EffectSpec
from workbench.servo import ServoLaw


class ReflectedInertia(Effect):
    """Rotor and gear have more inertia at the joint than nominal."""

    name = "reflected_inertia"
    layer = "actuator"
    places = ("joint",)
    parameters = (Parameter("inertia", "kg m^2", 0.0, 0.1, 0.003),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} carries {spec.parameters['inertia']:.4f} kg m^2 more reflected inertia."

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        inertia = law.inertia.copy()
        inertia[columns] += values["inertia"]
        return replace(law, inertia=inertia)


EFFECT = ReflectedInertia()
