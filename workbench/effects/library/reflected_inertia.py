"""Rotor and gear have more inertia at the joint than nominal, or less."""

from __future__ import annotations

from workbench.effects.base import Parameter, scalar
from workbench.effects.servo_constant import ServoConstant, above_or_below
from workbench.robot import EffectSpec


class ReflectedInertia(ServoConstant):
    """Rotor and gear have more inertia at the joint than nominal, or less."""

    name = "reflected_inertia"
    field = "inertia"
    parameters = (Parameter("inertia", "kg m^2", 0.0, 0.1, 0.003, adds_to="reflected_inertia"),)

    def sentence(self, spec: EffectSpec) -> str:
        inertia, where = scalar(spec, "inertia"), ", ".join(spec.where)
        return f"The reflected inertia of {where} is {abs(inertia):.4f} kg m^2 {above_or_below(inertia)} nominal."


EFFECT = ReflectedInertia()
