"""An asset's frame is not where it is said to be: its markers moved, or it was made in another pose."""

from __future__ import annotations

from workbench.effects.base import DEGREE, Effect, Parameter
from workbench.robot import EffectSpec


class MarkerFrame(Effect):
    """An asset's frame is not where it is said to be: its markers moved, or it was made in another pose."""

    name = "marker_frame"
    layer = "measurement"
    places = ("rigid_body",)
    parameters = (Parameter("rotation", "deg", -180.0, 180.0, 3.0, si=DEGREE, vector=True),)

    def sentence(self, spec: EffectSpec) -> str:
        x, y, z = spec.parameters["rotation"]  # type: ignore[misc]
        return f"The frame of {', '.join(spec.where)} is turned by ({x:.1f}, {y:.1f}, {z:.1f}) deg."


EFFECT = MarkerFrame()
