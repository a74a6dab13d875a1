"""One foot has more or less friction on the floor than the others."""

from __future__ import annotations

from collections.abc import Mapping

from workbench.effects.base import Parameter
from workbench.effects.floor_friction import FloorFriction
from workbench.physical import GROUND
from workbench.robot import EffectSpec


class FootFriction(FloorFriction):
    """One foot has more or less friction on the floor than the others."""

    name = "foot_friction"
    places = ("foot",)
    parameters = (Parameter("friction", "1", GROUND["friction"].low, GROUND["friction"].high, 0.3, replaces=True),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The friction coefficient of foot {', '.join(spec.where)} on the floor is {spec.parameters['friction']:.2f}."

    def foot_friction(self, values: Mapping[str, float]) -> float:
        return values["friction"]


EFFECT = FootFriction()
