"""A link carries an additional mass that is not in the model."""

from __future__ import annotations

import numpy as np

from workbench.effects.base import Effect, Parameter, scalar, si_values, vector
from workbench.effects.sdf import SdfRobot
from workbench.physical import MASS
from workbench.robot import EffectSpec, RobotModel


class Payload(Effect):
    """A link carries an additional mass that is not in the model."""

    name = "payload"
    layer = "inertia"
    places = ("link",)
    family = "mass"
    tied = "gravity against torque"
    point_mass = True
    includes = ("com_shift",)
    reduces_to = "com_shift"
    parameters = (
        Parameter("mass", "kg", MASS.least, MASS.most, 0.05),
        Parameter("position", "m", -0.5, 0.5, 0.02, vector=True),
    )

    def sentence(self, spec: EffectSpec) -> str:
        x, y, z = spec.parameters["position"]  # type: ignore[misc]
        return (f"{', '.join(spec.where)} carries an additional {1000 * scalar(spec, 'mass'):.0f} g at ({1000 * x:.0f}, "
                f"{1000 * y:.0f}, {1000 * z:.0f}) mm in its frame.")

    def as_other(self, name: str, spec: EffectSpec, model: RobotModel) -> tuple[float, ...]:
        if name != self.reduces_to:
            return ()
        (link,), mass = spec.where, scalar(spec, "mass")
        k = model.kinematics
        share = mass / (k.masses[link] + mass)
        return tuple(share * (np.array(spec.parameters["position"]) - k.centers.get(link, 0.0)))

    def description(self, sdf: SdfRobot, spec: EffectSpec, model: RobotModel) -> None:
        values = si_values(self, spec)
        for link in spec.where:
            sdf.add_point_mass(link, values["mass"], vector(values, "position"))


EFFECT = Payload()
