"""Something pulls a joint back to neutral: a cable across it, as a spring."""

from __future__ import annotations

from workbench.effects.base import Effect, Parameter, scalar, si_values
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel


class ParallelSpring(Effect):
    """Something pulls a joint back to neutral: a cable across it, as a spring.

    It acts on the servo's joint: where play or a soft gear is at the same joint, on the servo's side of it.
    """

    name = "parallel_spring"
    layer = "structure"
    places = ("joint",)
    tied = "gravity against torque"
    parameters = (Parameter("stiffness", "N m/rad", 0.0, 20.0, 0.1),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"Something pulls {', '.join(spec.where)} back to neutral with {scalar(spec, 'stiffness'):.2f} N m/rad."

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        values = si_values(self, spec)
        for joint in spec.where:
            sdf.add_parallel_spring(joint, values["stiffness"])


EFFECT = ParallelSpring()
