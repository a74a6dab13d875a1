"""The floor is not level: in its frame gravity is tilted forward or left; a stand is on the same floor."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from workbench.effects.base import DEGREE, Effect, Parameter, si_values
from workbench.robot import GRAVITY, EffectSpec, RobotModel
from workbench.types import Array


class GroundTilt(Effect):
    """The floor is not level: in its frame gravity is tilted forward or left; a stand is on the same floor."""

    name = "ground_tilt"
    layer = "ground"
    places = ("robot",)
    family = "ground pull"
    tied = "gravity against torque"
    steady_pull = True
    equivalent_to = ("tether_force",)
    parameters = (
        Parameter("forward", "deg", -30.0, 30.0, 1.0, si=DEGREE),
        Parameter("left", "deg", -30.0, 30.0, 1.0, si=DEGREE),)

    def sentence(self, spec: EffectSpec) -> str:
        forward, left = spec.parameters["forward"], spec.parameters["left"]
        return f"Gravity is tilted by {forward:.1f} deg forward and {left:.1f} deg to the left relative to the floor's normal."

    def as_other(self, name: str, spec: EffectSpec, model: RobotModel) -> tuple[float, ...]:
        if name not in self.equivalent_to:
            return ()
        values, weight = si_values(self, spec), GRAVITY * model.kinematics.mass
        return weight * math.tan(values["forward"]), weight * math.tan(values["left"]), 0.0

    def gravity(self, gravity: Array, values: Mapping[str, float]) -> Array:
        size = np.linalg.norm(gravity)
        lean = np.array([np.tan(values["forward"]), np.tan(values["left"]), -1.0])
        return np.asarray(size * lean / np.linalg.norm(lean))


EFFECT = GroundTilt()
