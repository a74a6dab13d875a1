"""Coulomb friction that grows with the torque that the gear transmits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import DEGREE, Effect, Parameter, scalar
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import Instant, ServoLaw, ServoTerm, TermNumbers

Array = NDArray[np.float64]

MOST_LOAD = 2.0
"""Of the torque at full duty: beyond it friction grows no further, as the solver needs a bound."""


@dataclass(frozen=True)
class _Rubbing(ServoTerm):
    """here (n,): 1 where it is, else 0. speed [rad/s]."""

    here: Array
    coefficient: float
    static: float
    speed: float
    backdrive: float

    def friction(self, now: Instant) -> Array:
        share = self.coefficient + self.static * np.exp(-np.square(now.velocity / self.speed))
        share = share + self.backdrive * np.maximum(-np.sign(now.motor) * now.direction, 0.0)
        return np.asarray(self.here * share * np.abs(now.load))

    def most_friction(self, law: ServoLaw) -> Array:
        return np.asarray(self.here * (self.coefficient + self.static + self.backdrive) * MOST_LOAD * law.full_torque)

    def numbers(self) -> TermNumbers:
        return TermNumbers(rubbing=self.here * self.coefficient, rubbing_still=self.here * self.static, rubbing_speed=self.speed,
                           rubbing_backwards=self.here * self.backdrive)


class LoadFriction(Effect):
    """Coulomb friction that grows with the torque that the gear transmits. Driven backwards, the gear needs 1 / (1 - coefficient)
    of its Coulomb friction to turn; from a coefficient of 1 on it cannot be driven backwards.

    Two options, as published friction models of such servos have them (M. Duclusaud and G. Passault, arXiv 2410.08650): `static`,
    more at rest, fading as exp(-(w / speed)^2); `backdrive`, more where motor and motion are opposed, so that the load drives the
    motor. Grows up to a load of MOST_LOAD times the torque at full duty.
    """

    name = "load_friction"
    layer = "actuator"
    places = ("joint",)
    family = "friction"
    under_load = True
    parameters = (
        Parameter("coefficient", "", 0.0, 1.0, 0.15),
        Parameter("static", "", 0.0, 1.0, 0.15, option="static"),
        Parameter("speed", "deg/s", 0.5, 400.0, 20.0, si=DEGREE, shapes=True, option="static"),
        Parameter("backdrive", "", 0.0, 1.0, 0.15, option="backdrive"))

    def sentence(self, spec: EffectSpec) -> str:
        static, backdrive = (float(spec.parameters.get(name, 0.0)) for name in ("static", "backdrive"))  # type: ignore[arg-type]
        more = [f"{100 * static:.0f} % more at rest"] if static else []
        more += [f"{100 * backdrive:.0f} % more where the load drives the motor"] if backdrive else []
        said = f", and by {' and by '.join(more)}" if more else ""
        return f"{', '.join(spec.where)} rubs by {100 * scalar(spec, 'coefficient'):.0f} % of the torque that it transmits{said}."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return 0.0, 0.0, self.parameters[2].typical, 0.0

    def servo_term(self, here: NDArray[np.bool_], values: Mapping[str, float]) -> ServoTerm:
        return _Rubbing(here.astype(float), values["coefficient"], values["static"], values["speed"], values["backdrive"])


EFFECT = LoadFriction()
