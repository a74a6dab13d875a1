"""Friction that grows with a joint's speed, beyond nominal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect, Parameter
from workbench.robot import EffectSpec
from workbench.servo import ServoLaw


class ViscousFriction(Effect):
    """Friction that grows with a joint's speed, beyond nominal."""

    name = "viscous_friction"
    layer = "actuator"
    places = ("joint",)
    family = "friction"
    parameters = (Parameter("coefficient", "N m s/rad", 0.0, 2.0, 0.03),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} has {spec.parameters['coefficient']:.3f} N m s/rad more viscous friction."

    def law(self, law: ServoLaw, columns: NDArray[np.int_], values: Mapping[str, float]) -> ServoLaw:
        viscous = law.viscous.copy()
        viscous[columns] += values["coefficient"]
        return replace(law, viscous=viscous)


EFFECT = ViscousFriction()
