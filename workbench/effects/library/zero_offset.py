"""The horn is mounted at an angle on its shaft: a constant between link angle and servo angle."""

from __future__ import annotations

from collections.abc import Mapping

from workbench.effects.base import DEGREE, Effect, Parameter
from workbench.robot import EffectSpec


class ZeroOffset(Effect):
    """The horn is mounted at an angle on its shaft: a constant between link angle and servo angle."""

    name = "zero_offset"
    layer = "structure"
    places = ("joint",)
    hidden_by_zeroing = True
    moves_feet = True
    estimator = "turn about an axis"
    resembles = "gravity against torque"  # seen from a rotated servo, gravity is tilted as on a tilted floor
    # a horn one tooth off: 14.4 deg of 25 teeth
    parameters = (Parameter("angle", "deg", -45.0, 45.0, 4.0, si=DEGREE, seldom_beyond=15.0),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} is offset by {spec.parameters['angle']:.1f} deg from its servo's zero."

    def zero(self, values: Mapping[str, float]) -> float:
        return values["angle"]


EFFECT = ZeroOffset()
