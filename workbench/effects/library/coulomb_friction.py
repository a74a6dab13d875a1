"""Dry friction in a servo's gear, beyond nominal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect, Parameter
from workbench.robot import EffectSpec
from workbench.servo import ServoLaw


class CoulombFriction(Effect):
    """Coulomb (dry) friction in a servo's gear, beyond nominal."""

    name = "coulomb_friction"
    layer = "actuator"
    places = ("joint",)
    family = "friction"
    parameters = (Parameter("torque", "N m", 0.0, 1.5, 0.03),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} has {spec.parameters['torque']:.3f} N m more dry friction."

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        coulomb = law.coulomb.copy()
        coulomb[columns] += values["torque"]
        return replace(law, coulomb=coulomb)


EFFECT = CoulombFriction()
