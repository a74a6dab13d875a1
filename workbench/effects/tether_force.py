"""A cable pulls at the robot with a steady force."""

from __future__ import annotations

from collections.abc import Mapping

from workbench.effects.base import Array, Effect, Parameter, vector
from workbench.robot import EffectSpec


class TetherForce(Effect):
    """A cable pulls at the robot with a steady force."""

    name = "tether_force"
    layer = "ground"
    places = ("robot",)
    twin = "ground_tilt"
    parameters = (Parameter("force", "N", -20.0, 20.0, 0.3, vector=True),)

    def sentence(self, spec: EffectSpec) -> str:
        return "Something pulls at the base with ({:.2f}, {:.2f}, {:.2f}) N.".format(*spec.parameters["force"])  # type: ignore[misc]

    def tether(self, values: Mapping[str, float]) -> Array:
        return vector(values, "force")


EFFECT = TetherForce()
