"""Common base of the effects on the friction between feet and floor, for every foot or for one."""

from __future__ import annotations

from workbench.effects.base import Effect
from workbench.robot import RobotModel


class FloorFriction(Effect):
    """Feet slide more or less easily than in the model."""

    layer = "ground"
    observable_when_fixed = False

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        """The model's own coefficient of friction."""
        return (1.0 if model.ground.friction is None else model.ground.friction,)
