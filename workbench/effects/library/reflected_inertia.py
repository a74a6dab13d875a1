"""Rotor and gear have more inertia at the joint than nominal."""

from __future__ import annotations

from workbench.effects.base import Parameter
from workbench.effects.servo_constant import ServoConstant
from workbench.robot import EffectSpec


class ReflectedInertia(ServoConstant):
    """Rotor and gear have more inertia at the joint than nominal."""

    name = "reflected_inertia"
    field = "inertia"
    parameters = (Parameter("inertia", "kg m^2", 0.0, 0.1, 0.003),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The reflected inertia of {', '.join(spec.where)} is {spec.parameters['inertia']:.4f} kg m^2 above nominal."


EFFECT = ReflectedInertia()
