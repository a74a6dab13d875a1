"""A link is longer or shorter than in the model, from its joint to the next."""

from __future__ import annotations

import numpy as np

from workbench.effects.base import Effect, Parameter, scalar, si_values
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel

SHARE = 0.5
"""Fraction of a link's length by which a search may change it."""


class LinkLength(Effect):
    """A link is longer or shorter than in the model, from its joint to the next.

    The links that it carries move along the line from its joint to the next (to the mean of several). At a last link the foot
    moves: the shapes with "foot" in their names, or else all collision shapes. The link's inertia is unchanged.
    """

    name = "link_length"
    layer = "structure"
    places = ("link",)
    moves_feet = True
    estimator = "length between axes"
    parameters = (Parameter("change", "m", -0.2, 0.2, 0.003),)

    def reach(self, sdf: SdfRobot, model: RobotModel, where: tuple[str, ...]) -> float:
        (link,) = where
        return SHARE * float(np.linalg.norm(sdf.way(model.kinematics, link)))

    def sentence(self, spec: EffectSpec) -> str:
        change = scalar(spec, "change")
        more = "longer" if change > 0 else "shorter"
        return f"{', '.join(spec.where)} is {1000 * abs(change):.1f} mm {more} than in the model."

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        values = si_values(self, spec)
        for link in spec.where:
            sdf.lengthen(link, values["change"])


EFFECT = LinkLength()
