"""Dry friction in a servo's gear, beyond nominal."""

from __future__ import annotations

from workbench.effects.base import Parameter
from workbench.effects.servo_constant import ServoConstant
from workbench.robot import EffectSpec


class CoulombFriction(ServoConstant):
    """Coulomb (dry) friction in a servo's gear, beyond nominal."""

    name = "coulomb_friction"
    field = "coulomb"
    family = "friction"
    parameters = (Parameter("torque", "N m", 0.0, 1.5, 0.03),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} has {spec.parameters['torque']:.3f} N m more dry friction."


EFFECT = CoulombFriction()
