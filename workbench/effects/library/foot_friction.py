"""One foot slides more or less easily than the others."""

from __future__ import annotations

from collections.abc import Mapping

from workbench.effects.base import Effect, Parameter
from workbench.robot import EffectSpec, RobotModel


class FootFriction(Effect):
    """One foot slides more or less easily than the others."""

    name = "foot_friction"
    layer = "ground"
    places = ("foot",)
    observable_when_fixed = False
    parameters = (Parameter("friction", "1", 0.02, 1.5, 0.3, replaces=True),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"Friction of foot {', '.join(spec.where)} on the floor is {spec.parameters['friction']:.2f}."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (1.0 if model.ground.friction is None else model.ground.friction,)

    def foot_friction(self, values: Mapping[str, float]) -> float:
        return values["friction"]


EFFECT = FootFriction()
