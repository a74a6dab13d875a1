"""The gear or horn of a servo twists under load: a spring between servo and link."""

from __future__ import annotations

import math

from workbench.effects.base import Effect, Parameter, scalar, si_values
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel


class JointCompliance(Effect):
    """The gear or horn of a servo twists under load: a spring between servo and link.

    The sensor and the reflected inertia are on the servo's side. The spring is damped by 1 ms times its stiffness (SPRING_TIME),
    a loss factor of 0.06 at 10 Hz.
    """

    name = "joint_compliance"
    layer = "structure"
    places = ("joint",)
    under_load = True
    needs_steady_load = True
    parameters = (Parameter("stiffness", "N m/rad", 0.2, 1e4, 10.0),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} is coupled to its servo with a stiffness of {scalar(spec, 'stiffness'):.1f} N m/rad."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (math.inf,)

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        values = si_values(self, spec)
        for joint in spec.where:
            sdf.add_compliance(joint, values["stiffness"])


EFFECT = JointCompliance()
