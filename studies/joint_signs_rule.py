"""By what a choice of joint signs is judged (studies/joint_signs.py)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.gait import Gait

Array = NDArray[np.float64]
FREE = ("flm", "flb", "flt", "blm", "blb", "blt", "tail")
"""Joints whose signs symmetry leaves open; the right legs follow the left ones."""
Choice = tuple[int, ...]
FINAL_ROLL = float(np.radians(-1.0)), float(np.radians(0.74))
FINAL_PITCH = float(np.radians(-0.16)), float(np.radians(0.83))
"""Rotations about x and z in which the thesis's runs ended (7.2.2)."""


def label(choice: Choice) -> str:
    """Signs of the left legs' joints and of the tail, as text."""
    return " ".join(f"{j}{'+' if s > 0 else '-'}" for j, s in zip(FREE, choice))


def knees_alike(choice: Choice, angles: Mapping[str, Array]) -> bool:
    """Front and hind knees bend the same way, by their mean angles over a cycle."""
    return bool(np.prod([choice[FREE.index(j)] * np.mean(angles[j]) for j in ("flb", "blb")]) > 0)


@dataclass(frozen=True)
class Verdict:
    """A choice's runs, one for each condition, against what is known of the robot other than how far it walks."""

    choice: Choice
    alike: bool
    gaits: Sequence[Gait]

    @property
    def walked(self) -> int:
        """Conditions in which it walks."""
        return sum(g.walks for g in self.gaits)

    def mean(self, quantity: Callable[[Gait], float]) -> float:
        """Mean of a quantity over the conditions."""
        return float(np.mean([quantity(g) for g in self.gaits]))

    @property
    def tail(self) -> float:
        return self.mean(lambda g: g.tail)

    def spread(self, angle: Callable[[Gait], tuple[float, float, float]]) -> tuple[float, float, float]:
        """Lowest, mean and highest roll or pitch [rad] of the last cycle, each the mean over the conditions."""
        low, mean, high = np.mean([angle(g) for g in self.gaits], axis=0)
        return float(low), float(mean), float(high)

    def met(self) -> dict[str, bool]:
        """What the thesis saw, by its short name. Attitude: angles in which its runs ended overlap those of the last cycle."""
        def overlap(spread: tuple[float, float, float], final: tuple[float, float]) -> bool:
            return spread[0] < final[1] and spread[2] > final[0]

        return {"front pulls": self.mean(lambda g: g.front_pull) > 0, "tail smaller": self.tail < 1,
                "tops smaller": self.mean(lambda g: float(np.mean(g.tops))) < 1,
                "attitude": (overlap(self.spread(lambda g: g.roll), FINAL_ROLL)
                             and overlap(self.spread(lambda g: g.pitch), FINAL_PITCH))}

    @property
    def rank(self) -> tuple[bool, int, int, float]:
        """The rule; the lowest is chosen: knees alike, walks in most conditions, most criteria met, the smaller tail."""
        return not self.alike, -self.walked, -sum(self.met().values()), self.tail
