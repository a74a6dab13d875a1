"""Motors get weaker as they get warm."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from workbench.effects.base import Effect, Parameter, scalar
from workbench.robot import EffectSpec
from workbench.servo import Instant, ServoLaw, ServoTerm, TermNumbers
from workbench.types import Mask


@dataclass(frozen=True)
class _Fading(ServoTerm):
    """rate [1/s]."""

    rate: float

    def strength(self, law: ServoLaw, now: Instant) -> float:
        return math.exp(-self.rate * now.elapsed)

    def numbers(self) -> TermNumbers:
        return TermNumbers(fade=self.rate)


class ThermalFade(Effect):
    """Motors get weaker as they get warm: duty torque decays with the time since each take's first command."""

    name = "thermal_fade"
    layer = "actuator"
    places = ("robot",)
    family = "electrical"
    under_load = True
    parameters = (Parameter("rate", "1/s", 0.0, 1.0, 0.01),)

    def sentence(self, spec: EffectSpec) -> str:
        return f"The servos lose {100 * scalar(spec, 'rate'):.1f} % of their torque per second after the first command."

    def servo_term(self, here: Mask, values: Mapping[str, float]) -> ServoTerm:
        return _Fading(values["rate"])


EFFECT = ThermalFade()
