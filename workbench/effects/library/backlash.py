"""Free play in a servo's gear: the link can turn a little while the servo does not move."""

from __future__ import annotations

from workbench.effects.base import DEGREE, Effect, Parameter, scalar, si_values
from workbench.effects.sdf import SdfRobot
from workbench.robot import EffectSpec, RobotModel


class Backlash(Effect):
    """Free play in a servo's gear: the link can turn a little while the servo does not move.

    The sensor and the reflected inertia are on the servo's side. The play is centred on the servo's angle, has hard ends without
    bounce, and is nearly free of friction.
    """

    name = "backlash"
    layer = "structure"
    places = ("joint",)
    under_load = True
    needs_steady_load = True
    free_play = "gap"
    # measured on hobby servos: 0.6 to 1.3 deg; worn ones are reported to have "at least 2"
    parameters = (Parameter("gap", "deg", 0.0, 30.0, 1.0, si=DEGREE, seldom_beyond=4.0),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} has {scalar(spec, 'gap'):.1f} deg of free play between servo and link."

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        values = si_values(self, spec)
        for joint in spec.where:
            sdf.add_play(joint, values["gap"])


EFFECT = Backlash()
