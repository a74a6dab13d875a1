"""An asset's frame is not where it is said to be: its markers moved, or it was made in another pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.effects.base import DEGREE, Effect, Parameter, si_values, vector
from workbench.recording.recording import Measurement
from workbench.robot import EffectSpec


class MarkerFrame(Effect):
    """An asset's frame is not where it is said to be: its markers moved, or it was made in another pose.

    Assets are made in neutral with their frames parallel to the capture's axes (Motive's: x forward up to a yaw, y up, z right),
    so the rotation vector's components are along these at rest. The recording starts with that rotation in place of none. As
    zeros are taken as stated, it shows at rest as constant angles, opposite ones in the joints on either side of the
    link, and in motion as rotation about axes that no servo turns. The pivot stays.
    """

    name = "marker_frame"
    layer = "measurement"
    places = ("rigid_body",)
    estimator = "turn of an asset at rest"
    from_neutral = False
    parameters = (Parameter("rotation", "deg", -180.0, 180.0, 3.0, si=DEGREE, vector=True),)

    def sentence(self, spec: EffectSpec) -> str:
        x, y, z = spec.parameters["rotation"]  # type: ignore[misc]
        return f"The frame of {', '.join(spec.where)} is turned by ({x:.1f}, {y:.1f}, {z:.1f}) deg."

    def measurement(self, measurement: Measurement, spec: EffectSpec) -> Measurement:
        turn = Rotation.from_rotvec(vector(si_values(self, spec), "rotation"))
        old = {a: Rotation.from_rotvec(measurement.frames.get(a, np.zeros(3))) for a in spec.where}
        return replace(measurement, frames={**measurement.frames, **{a: (r * turn).as_rotvec() for a, r in old.items()}})


EFFECT = MarkerFrame()
