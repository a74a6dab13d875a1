"""A servo sticks: it has more dry friction at rest than in motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.effects.base import DEGREE, Effect, Parameter, scalar
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import Instant, ServoLaw, ServoTerm, TermNumbers
from workbench.types import Array, Mask


@dataclass(frozen=True)
class _Sticking(ServoTerm):
    """torque: (n,) [N m]; speed [rad/s]."""

    torque: Array
    speed: float

    def friction(self, now: Instant) -> Array:
        return np.asarray(self.torque * np.exp(-np.square(now.velocity / self.speed)))

    def most_friction(self, law: ServoLaw) -> Array:
        return self.torque

    def numbers(self) -> TermNumbers:
        return TermNumbers(sticking=self.torque, speed=self.speed)


class StribeckFriction(Effect):
    """Additional Coulomb friction at rest, decaying with speed as exp(-(w / speed)^2) (Stribeck; Armstrong-Helouvry 1994)."""

    name = "stribeck_friction"
    layer = "actuator"
    places = ("joint",)
    family = "friction"
    reduces_to = "coulomb_friction"
    parameters = (
        Parameter("torque", "N m", 0.0, 1.5, 0.05),
        Parameter("speed", "deg/s", 0.5, 400.0, 20.0, si=DEGREE, shapes=True))

    def sentence(self, spec: EffectSpec) -> str:
        return (f"{', '.join(spec.where)} sticks: {scalar(spec, 'torque'):.3f} N m more dry friction at rest, "
                f"which vanishes above about {2 * scalar(spec, 'speed'):.0f} deg/s.")

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return 0.0, self.parameters[1].typical

    def servo_term(self, here: Mask, values: Mapping[str, float]) -> ServoTerm:
        return _Sticking(here.astype(float) * values["torque"], values["speed"])


EFFECT = StribeckFriction()
