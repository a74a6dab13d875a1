"""An asset's frame is rotated: its markers moved, or it was defined in another pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.effects.base import DEGREE, Effect, Parameter, si_values, vector
from workbench.recording.recording import Measurement
from workbench.robot import EffectSpec


class MarkerFrame(Effect):
    """An asset's frame is rotated: its markers moved, or it was defined in another pose.

    Assets are defined in neutral with their frames parallel to the capture's axes (Motive's: x forward up to a yaw, y up, z
    right), so at rest the components of the rotation vector are along these. The recording starts with that rotation instead of
    none. At rest it appears as constant angles, with opposite signs in the joints on either side of the link, and in motion as
    rotation about axes that no servo turns. The pivot does not move.
    """

    name = "marker_frame"
    layer = "measurement"
    places = ("rigid_body",)
    estimator = "turn of an asset at rest"
    from_neutral = False
    parameters = (Parameter("rotation", "deg", -180.0, 180.0, 3.0, si=DEGREE, vector=True),)

    def sentence(self, spec: EffectSpec) -> str:
        x, y, z = spec.parameters["rotation"]  # type: ignore[misc]
        return f"The marker frame of {', '.join(spec.where)} is rotated by ({x:.1f}, {y:.1f}, {z:.1f}) deg."

    def measurement(self, measurement: Measurement, spec: EffectSpec) -> Measurement:
        turn = Rotation.from_rotvec(vector(si_values(self, spec), "rotation"))
        old = {a: Rotation.from_rotvec(measurement.frames.get(a, np.zeros(3))) for a in spec.where}
        return replace(measurement, frames={**measurement.frames, **{a: (r * turn).as_rotvec() for a, r in old.items()}})


EFFECT = MarkerFrame()
