"""A servo stops within a wider margin around its goal than nominal, or a narrower one."""

from __future__ import annotations

from workbench.effects.base import DEGREE, Parameter, scalar
from workbench.effects.servo_constant import ServoConstant
from workbench.robot import EffectSpec


class DeadBand(ServoConstant):
    """A servo stops within a wider margin around its goal than nominal, or a narrower one."""

    name = "dead_band"
    field = "margin"
    # seven counts of an AX-12A, 23 of a servo of 4096: a register setting, not wear
    parameters = (Parameter("margin", "deg", 0.0, 15.0, 0.5, si=DEGREE, seldom_beyond=2.0, adds_to="margin"),)

    def sentence(self, spec: EffectSpec) -> str:
        margin, where = scalar(spec, "margin"), ", ".join(spec.where)
        change = f"{abs(margin):.1f} deg {'narrower' if margin < 0 else 'wider'}"
        return f"The dead band of {where} is {change} on each side of its goal."


EFFECT = DeadBand()
