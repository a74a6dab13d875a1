"""A link's centre of mass differs from the model's."""

from __future__ import annotations

from workbench.effects.base import Effect, Parameter, si_values, vector
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel
from workbench.robot.model_source import link_sizes

SHARE = 0.5
"""Fraction of a link's size by which a search may move its centre of mass: one that is in the middle stays within the link."""


class ComShift(Effect):
    """A link's centre of mass differs from the model's."""

    name = "com_shift"
    layer = "inertia"
    places = ("link",)
    title = "centre of mass shift"
    family = "mass"
    tied = "gravity against torque"
    moves_center = True
    parameters = (Parameter("offset", "m", -0.2, 0.2, 0.005, vector=True),)

    def reach(self, sdf: SdfRobot, model: RobotModel, where: tuple[str, ...]) -> float:
        (link,) = where
        return SHARE * link_sizes(sdf.path)[link]

    def sentence(self, spec: EffectSpec) -> str:
        x, y, z = spec.parameters["offset"]  # type: ignore[misc]
        return (f"The centre of mass of {', '.join(spec.where)} is displaced by ({1000 * x:.1f}, {1000 * y:.1f}, "
                f"{1000 * z:.1f}) mm in the link's frame.")

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        values = si_values(self, spec)
        for link in spec.where:
            sdf.shift_center(link, vector(values, "offset"))


EFFECT = ComShift()
