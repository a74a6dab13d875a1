"""A weight of known mass, attached to a link in one take."""

from __future__ import annotations

from dataclasses import dataclass

from workbench.effects.library.payload import EFFECT
from workbench.robot import EffectSpec, RobotModel

MOST_MASS, FURTHEST = EFFECT.parameters[0].high, EFFECT.parameters[1].high
"""Largest weight [kg], and largest distance along each axis of its link's frame [m]."""


@dataclass(frozen=True)
class KnownLoad:
    """A point of `mass` [kg] at `position` (3,) [m] in the frame of `link`."""

    link: str
    mass: float
    position: tuple[float, float, float]

    def on(self, model: RobotModel) -> RobotModel:
        """The robot with the weight."""
        return model.with_effect(EffectSpec(EFFECT.name, (self.link,), {"mass": self.mass, "position": self.position}))
