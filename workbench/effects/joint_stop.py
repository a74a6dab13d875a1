"""A joint ends before its servo does."""

from __future__ import annotations

import math

from workbench.effects.base import DEGREE, Effect, Parameter, scalar, si_values
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel


class JointStop(Effect):
    """A joint ends before its servo does.

    The stop is on the servo's side. Where the robot's description ends nearer, that end stays.
    """

    name = "joint_stop"
    layer = "structure"
    places = ("joint",)
    parameters = (
        Parameter("lower", "deg", -180.0, 180.0, -30.0, si=DEGREE),
        Parameter("upper", "deg", -180.0, 180.0, 30.0, si=DEGREE),
    )

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} goes no further than {scalar(spec, 'lower'):.1f} and {scalar(spec, 'upper'):.1f} deg."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (-math.inf, math.inf)

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        values = si_values(self, spec)
        for joint in spec.where:
            sdf.set_stop(joint, values["lower"], values["upper"])


EFFECT = JointStop()
