"""A servo stops within a wider margin around its goal than nominal."""

from __future__ import annotations

from workbench.effects.base import DEGREE, Parameter
from workbench.effects.servo_constant import ServoConstant
from workbench.robot import EffectSpec


class DeadBand(ServoConstant):
    """A servo stops within a wider margin around its goal than nominal."""

    name = "dead_band"
    field = "margin"
    # seven counts of an AX-12A, 23 of a servo of 4096: a register setting, not wear
    parameters = (Parameter("margin", "deg", 0.0, 15.0, 0.5, si=DEGREE, seldom_beyond=2.0),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The dead band of {', '.join(spec.where)} is {spec.parameters['margin']:.1f} deg wider on each side of its goal."


EFFECT = DeadBand()
