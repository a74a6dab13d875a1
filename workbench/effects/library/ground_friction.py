"""All feet have more or less friction on this floor than nominal."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from workbench.effects.base import Parameter
from workbench.effects.floor_friction import FloorFriction
from workbench.physical import GROUND
from workbench.robot import EffectSpec, Ground


class GroundFriction(FloorFriction):
    """All feet have more or less friction on this floor than nominal."""

    name = "ground_friction"
    places = ("robot",)
    parameters = (Parameter("friction", "1", GROUND["friction"].low, GROUND["friction"].high, 0.4, replaces=True),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The friction coefficient between feet and floor is {spec.parameters['friction']:.2f}."

    def ground(self, ground: Ground, values: Mapping[str, float]) -> Ground:
        return replace(ground, friction=values["friction"])


EFFECT = GroundFriction()
