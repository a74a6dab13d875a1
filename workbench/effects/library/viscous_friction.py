"""Friction that grows with a joint's speed, beyond nominal."""

from __future__ import annotations

from workbench.effects.base import Parameter
from workbench.effects.servo_constant import ServoConstant
from workbench.robot import EffectSpec


class ViscousFriction(ServoConstant):
    """Friction that grows with a joint's speed, beyond nominal."""

    name = "viscous_friction"
    field = "viscous"
    family = "friction"
    parameters = (Parameter("coefficient", "N m s/rad", 0.0, 2.0, 0.03),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} has {spec.parameters['coefficient']:.3f} N m s/rad more viscous friction."


EFFECT = ViscousFriction()
