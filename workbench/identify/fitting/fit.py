"""Effects fitted together: sizes, covariance, cost and residuals."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from workbench.identify.parameters import Candidate, Key, with_effects
from workbench.robot import RobotModel
from workbench.types import Array

Sizes = list[tuple[Candidate, Array]]
"""Effects, each with its sizes."""


@dataclass(frozen=True)
class Slopes:
    """Derivatives of the fitted `vector` by some parameters of a fit (indices of x) on some takes, at the search's step. joint:
    whose channels alone, None for all."""

    numbers: NDArray[np.int_]
    takes: tuple[int, ...]
    J: Array
    joint: str | None = None


@dataclass(frozen=True)
class Fit:
    """Effects fitted together. x: sizes of all their parameters; covariance of x, infinite where the data do not constrain it.

    cost: chi squared by use ("fit", "choose", "validate"); residuals by take.
    """

    effects: tuple[Candidate, ...]
    x: Array
    covariance: Array
    cost: dict[str, float]
    residuals: dict[int, Array] = field(repr=False)
    slopes: tuple[Slopes, ...] = field(default=(), repr=False)

    def slices(self) -> list[slice]:
        """The part of x that belongs to each effect."""
        ends = np.cumsum([0, *(c.size for c in self.effects)]).tolist()
        return [slice(a, b) for a, b in pairwise(ends)]

    def numbers(self, effects: Iterable[int]) -> NDArray[np.int_]:
        """Indices of x, of some effects."""
        slices = self.slices()
        return np.concatenate([np.empty(0, dtype=int), *(np.arange(slices[i].start, slices[i].stop) for i in effects)])

    def sizes(self, x: Array | None = None) -> Sizes:
        """Each effect with its sizes, from the fit's own x or from another."""
        x = self.x if x is None else x
        return [(c, x[s]) for c, s in zip(self.effects, self.slices())]

    def sizes_without(self, key: Key) -> Sizes:
        """The sizes of every effect except one."""
        return [s for s in self.sizes() if s[0].key != key]

    def sizes_with(self, key: Key, x: Array) -> Sizes:
        """The sizes of every effect, one of them replaced."""
        return [(c, x if c.key == key else own) for c, own in self.sizes()]

    def sizes_by_key(self) -> dict[Key, Array]:
        """Name and place of each effect."""
        return {c.key: x for c, x in self.sizes()}

    def bounds(self) -> tuple[Array, Array]:
        """Bounds of x."""
        ends = [(np.empty(0), np.empty(0)), *(c.bounds() for c in self.effects)]
        return np.concatenate([low for low, _ in ends]), np.concatenate([high for _, high in ends])

    def model(self, nominal: RobotModel) -> RobotModel:
        """The nominal robot with these effects."""
        return with_effects(nominal, self.sizes())
