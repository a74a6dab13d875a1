"""A cable pulls on the robot with a constant force."""

from __future__ import annotations

import math
from collections.abc import Mapping

from workbench.effects.base import Effect, Parameter, si_values, vector
from workbench.robot import GRAVITY, EffectSpec, RobotModel
from workbench.types import Array


class TetherForce(Effect):
    """A cable pulls on the robot with a constant force."""

    name = "tether_force"
    layer = "ground"
    places = ("robot",)
    family = "ground pull"
    observable_when_fixed = False
    steady_pull = True
    equivalent_to = ("ground_tilt",)
    parameters = (Parameter("force", "N", -20.0, 20.0, 0.3, vector=True),)

    def sentence(self, spec: EffectSpec) -> str:
        return "An external force of ({:.2f}, {:.2f}, {:.2f}) N acts on the base.".format(*spec.parameters["force"])  # type: ignore[misc]

    def as_other(self, name: str, spec: EffectSpec, model: RobotModel) -> tuple[float, ...]:
        if name not in self.equivalent_to:
            return ()
        x, y, _ = vector(si_values(self, spec), "force")
        weight = GRAVITY * model.kinematics.mass
        return math.degrees(math.atan(x / weight)), math.degrees(math.atan(y / weight))

    def tether(self, values: Mapping[str, float]) -> Array:
        return vector(values, "force")


EFFECT = TetherForce()
