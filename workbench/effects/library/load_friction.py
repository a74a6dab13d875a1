"""A gear that rubs the more, the more torque it transmits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.effects.base import Effect, Parameter, scalar
from workbench.robot import EffectSpec
from workbench.servo import Instant, ServoLaw, ServoTerm, TermNumbers

Array = NDArray[np.float64]

MOST_LOAD = 2.0
"""Of the torque at full duty: beyond it friction grows no further, as the solver needs a bound."""


@dataclass(frozen=True)
class _Rubbing(ServoTerm):
    """coefficient: (n,)."""

    coefficient: Array

    def friction(self, now: Instant) -> Array:
        return np.asarray(self.coefficient * np.abs(now.load))

    def most_friction(self, law: ServoLaw) -> Array:
        return np.asarray(self.coefficient * MOST_LOAD * law.full_torque)

    def numbers(self) -> TermNumbers:
        return TermNumbers(rubbing=self.coefficient)


class LoadFriction(Effect):
    """A gear that rubs the more, the more torque it hands to its link; driven backwards it takes 1 / (1 - coefficient) of its
    Coulomb friction to turn, and from 1 on it cannot be driven backwards.

    Grows up to a load of MOST_LOAD times the torque at full duty.
    """

    name = "load_friction"
    layer = "actuator"
    places = ("joint",)
    family = "friction"
    under_load = True
    parameters = (Parameter("coefficient", "", 0.0, 1.0, 0.15),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"{', '.join(spec.where)} rubs by {100 * scalar(spec, 'coefficient'):.0f} % of the torque that it transmits."

    def servo_term(self, here: NDArray[np.bool_], values: Mapping[str, float]) -> ServoTerm:
        return _Rubbing(here.astype(float) * values["coefficient"])


EFFECT = LoadFriction()
