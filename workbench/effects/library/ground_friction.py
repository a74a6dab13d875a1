"""All feet slide more or less easily on this floor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from workbench.effects.base import Effect, Parameter
from workbench.robot import EffectSpec, Ground, RobotModel


class GroundFriction(Effect):
    """All feet slide more or less easily on this floor."""

    name = "ground_friction"
    layer = "ground"
    places = ("robot",)
    observable_when_fixed = False
    parameters = (Parameter("friction", "1", 0.02, 1.5, 0.4, replaces=True),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"Friction of feet and floor is {spec.parameters['friction']:.2f}."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (1.0 if model.ground.friction is None else model.ground.friction,)

    def ground(self, ground: Ground, values: Mapping[str, float]) -> Ground:
        return replace(ground, friction=values["friction"])


EFFECT = GroundFriction()
