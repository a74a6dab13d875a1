"""Screws are loose: a link rocks about an axis other than its servo's."""

from __future__ import annotations

from workbench.effects.base import DEGREE, Effect, Parameter, scalar, si_values, vector
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel


class LooseMount(Effect):
    """Screws are loose: a link rocks about an axis other than its servo's.

    `axis` is given in the link's frame (in neutral usually parallel to the base's) and passes through the joint's origin; its
    length does not matter. The mount is between the servo's horn and the link, so the axis turns with the servo.
    """

    name = "loose_mount"
    layer = "structure"
    places = ("joint",)
    estimator = "play across the axis"
    from_neutral = False
    free_play = "play"
    parameters = (
        Parameter("play", "deg", 0.0, 30.0, 1.0, si=DEGREE),
        Parameter("axis", "1", -1.0, 1.0, 1.0, vector=True),
    )

    def sentence(self, spec: EffectSpec) -> str:
        x, y, z = spec.parameters["axis"]  # type: ignore[misc]
        return (f"The link of {', '.join(spec.where)} is loose: it rocks by {scalar(spec, 'play'):.1f} deg about "
                f"({x:.2f}, {y:.2f}, {z:.2f}), which is not the servo's axis.")

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        values = si_values(self, spec)
        for joint in spec.where:
            sdf.add_loose_mount(joint, values["play"], vector(values, "axis"))


EFFECT = LooseMount()
