"""Which factor explains how much of a spread: variance decomposition of a full factorial design."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.common import COORDINATES
from studies.walk_spread.design import FACTORS, Design
from studies.walk_spread.runs import Ends

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shares:
    """Of the variance. main: by factor. pairs: by two factors together, beyond each alone; rest: by three and more.

    std: of all values.
    """

    main: Mapping[str, float]
    pairs: Mapping[tuple[str, str], float]
    rest: float
    std: float


def decompose(values: Array, factors: tuple[str, ...]) -> Shares:
    """Sums of squares of a balanced design, one run a cell. values: one axis for each factor, its levels along it.

    The effects of a balanced design are orthogonal, so their shares add up to one (Montgomery, Design and Analysis of
    Experiments, chapter 5). One factor's effect is the variance of its level means about the grand mean.
    """
    total = float(np.var(values))
    if total == 0:
        return Shares(dict.fromkeys(factors, 0.0), {}, 0.0, 0.0)
    centred = values - values.mean()

    def mean_over_others(*kept: int) -> Array:
        return np.asarray(centred.mean(axis=tuple(a for a in range(values.ndim) if a not in kept), keepdims=True))

    alone = [mean_over_others(a) for a in range(values.ndim)]
    main = {f: float(np.mean(alone[a] ** 2)) / total for a, f in enumerate(factors)}
    pairs = {(factors[a], factors[b]): float(np.mean((mean_over_others(a, b) - alone[a] - alone[b]) ** 2)) / total
             for a, b in itertools.combinations(range(values.ndim), 2)}
    return Shares(main, pairs, 1 - sum(main.values()) - sum(pairs.values()), float(np.sqrt(total)))


def grid(design: Design, ends: Ends, drive: str, coordinate: str) -> Array:
    """A coordinate of one drive's runs, an axis for each of FACTORS."""
    i = COORDINATES.index(coordinate)
    shape = [len(design.levels[f]) for f in FACTORS]
    crossed = [ends[c][i] for c in design.cases if c.drive == drive and not c.excursion]
    return np.array(crossed).reshape(shape)


def cloud(ends: Ends, drive: str, coordinate: str) -> Array:
    """The same as a list, excursions left out."""
    i = COORDINATES.index(coordinate)
    return np.array([end[i] for case, end in ends.items() if case.drive == drive and not case.excursion])
