"""More, or less, friction that grows with a joint's speed than nominal."""

from __future__ import annotations

from workbench.effects.base import Parameter, scalar
from workbench.effects.servo_constant import ServoConstant, more_or_less
from workbench.robot import EffectSpec


class ViscousFriction(ServoConstant):
    """More friction that grows with a joint's speed than nominal, or less."""

    name = "viscous_friction"
    field = "viscous"
    family = "friction"
    parameters = (Parameter("coefficient", "N m s/rad", 0.0, 2.0, 0.03, adds_to="viscous_friction"),)

    def sentence(self, spec: EffectSpec) -> str:
        coefficient = scalar(spec, "coefficient")
        return f"{', '.join(spec.where)} has {abs(coefficient):.3f} N m s/rad {more_or_less(coefficient)} viscous friction."


EFFECT = ViscousFriction()
