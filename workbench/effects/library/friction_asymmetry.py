"""A gear with more friction in one direction than in the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.effects.base import Effect, Parameter, scalar
from workbench.robot import EffectSpec, RobotModel
from workbench.servo import Instant, ServoTerm, TermNumbers
from workbench.types import Array, Mask


@dataclass(frozen=True)
class _Asymmetric(ServoTerm):
    """share: (n,) fraction by which friction is higher forwards and lower backwards."""

    share: Array

    def friction_ratio(self, now: Instant) -> Array:
        return np.asarray(1.0 + self.share * now.direction)

    def most_friction_ratio(self) -> Array:
        return np.asarray(1.0 + np.abs(self.share))

    def numbers(self) -> TermNumbers:
        return TermNumbers(lopsided=self.share)


class FrictionAsymmetry(Effect):
    """A gear with more friction in one direction than in the other: all Coulomb friction, whatever it depends on, is `ratio`
    times as high towards positive angles as towards negative ones; the mean of both is unchanged."""

    name = "friction_asymmetry"
    layer = "actuator"
    places = ("joint",)
    family = "friction"
    # 1.3 on an XL-330 (fit to the logs of Rhoban/bam)
    parameters = (Parameter("ratio", "", 0.1, 10.0, 1.3, seldom_beyond=2.5, logarithmic=True),)

    def sentence(self, spec: EffectSpec) -> str:
        ratio = scalar(spec, "ratio")
        way, other, more = ("positive", "negative", ratio) if ratio >= 1 else ("negative", "positive", 1 / ratio)
        return f"{', '.join(spec.where)} has {more:.2f} times as much dry friction towards {way} angles as towards {other} ones."

    def neutral(self, model: RobotModel) -> tuple[float, ...]:
        return (1.0,)

    def servo_term(self, here: Mask, values: Mapping[str, float]) -> ServoTerm:
        ratio = values["ratio"]
        return _Asymmetric(here.astype(float) * (ratio - 1.0) / (ratio + 1.0))


EFFECT = FrictionAsymmetry()
