"""A joint is pulled back to neutral, for example by a cable across it that acts like a spring."""

from __future__ import annotations

from workbench.effects.base import Effect, Parameter, scalar, si_values
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel


class ParallelSpring(Effect):
    """A joint is pulled back to neutral, for example by a cable across it that acts like a spring.

    It acts on the servo's joint; if the same joint has backlash or a compliant gear, on the servo's side of it.
    """

    name = "parallel_spring"
    layer = "structure"
    places = ("joint",)
    tied = "gravity against torque"
    parameters = (Parameter("stiffness", "N m/rad", 0.0, 20.0, 0.1),)

    def sentence(self, spec: EffectSpec) -> str:
        where = ", ".join(spec.where)
        return f"{where} is pulled back to neutral with {scalar(spec, 'stiffness'):.2f} N m/rad, as if by a taut cable."

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        values = si_values(self, spec)
        for joint in spec.where:
            sdf.add_parallel_spring(joint, values["stiffness"])


EFFECT = ParallelSpring()
