"""More, or less, dry friction in a servo's gear than nominal."""

from __future__ import annotations

from workbench.effects.base import Parameter, scalar
from workbench.effects.servo_constant import ServoConstant, more_or_less
from workbench.robot import EffectSpec


class CoulombFriction(ServoConstant):
    """More Coulomb (dry) friction in a servo's gear than nominal, or less."""

    name = "coulomb_friction"
    field = "coulomb"
    family = "friction"
    parameters = (Parameter("torque", "N m", 0.0, 1.5, 0.03, adds_to="coulomb_friction"),)

    def sentence(self, spec: EffectSpec) -> str:
        torque = scalar(spec, "torque")
        return f"{', '.join(spec.where)} has {abs(torque):.3f} N m {more_or_less(torque)} dry friction."


EFFECT = CoulombFriction()
