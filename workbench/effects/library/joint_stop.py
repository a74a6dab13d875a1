"""A joint's travel ends before that of its servo."""

from __future__ import annotations

import math

from workbench.effects.base import DEGREE, Effect, Parameter, scalar, si_values
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel

WHOLE = 180.0
"""Limit [deg] that no servo reaches."""


class JointStop(Effect):
    """A joint's travel ends before that of its servo.

    The stop is on the servo's side. If the robot's description has a nearer limit, that limit remains.
    """

    name = "joint_stop"
    layer = "structure"
    places = ("joint",)
    estimator = "end of travel"
    from_neutral = False
    parameters = (
        Parameter("lower", "deg", -WHOLE, WHOLE, -30.0, si=DEGREE),
        Parameter("upper", "deg", -WHOLE, WHOLE, 30.0, si=DEGREE),
    )

    def sentence(self, spec: EffectSpec) -> str:
        ends = [f"{way} than {scalar(spec, end):.1f} deg" for end, way in (("lower", "lower"), ("upper", "higher"))
                if abs(scalar(spec, end)) < WHOLE]
        return f"{', '.join(spec.where)} goes {' and '.join(f'no {e}' for e in ends) or 'as far as its servo'}."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (-math.inf, math.inf)

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        values = si_values(self, spec)
        for joint in spec.where:
            sdf.set_stop(joint, values["lower"], values["upper"])


EFFECT = JointStop()
