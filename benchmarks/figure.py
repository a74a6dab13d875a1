"""A measured figure with its requirement. The compared runs are timed in turns, so that a busy machine slows all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench.types import Array


@dataclass(frozen=True)
class Figure:
    """meaning: the quantity in words. value, quartiles: its median and quartiles over the turns; None where the measurement was
    skipped, and `skipped` gives the reason. at_least, below: the requirement, if there is one. aim: a goal beyond the
    requirement. details: the measurements behind the value."""

    name: str
    meaning: str
    value: float | None = None
    quartiles: tuple[float, float] | None = None
    at_least: float | None = None
    below: float | None = None
    aim: float | None = None
    details: Mapping[str, Any] = field(default_factory=dict)
    skipped: str | None = None

    @property
    def met(self) -> bool | None:
        """Whether the requirement is met; None where there is none, or no value."""
        if self.value is None or (self.at_least is None and self.below is None):
            return None
        return (self.at_least is None or self.value >= self.at_least) and (self.below is None or self.value < self.below)

    def to_json(self) -> dict[str, Any]:
        """Plain data, without the fields that do not apply."""
        requirement = {"at_least": self.at_least, "below": self.below, "aim": self.aim}
        out = {"meaning": self.meaning, "value": self.value, "quartiles": self.quartiles and list(self.quartiles),
               "requirement": {k: v for k, v in requirement.items() if v is not None} or None, "met": self.met,
               "details": dict(self.details) or None, "skipped": self.skipped}
        return {k: v for k, v in out.items() if v is not None}


def in_turns(runs: Mapping[str, Callable[[], object]], repeats: int, clock: Callable[[], float] = time.process_time,
             warm: bool = True) -> dict[str, Array]:
    """Seconds (repeats,) of each run, by its name. Every turn times all runs, one after the other.

    clock: processor time of this process, which other processes disturb least, or time.perf_counter for work that several
    processes or threads do. warm: makes one untimed turn first.
    """
    if warm:
        for run in runs.values():
            run()
    out: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repeats):
        for name, run in runs.items():
            began = clock()
            run()
            out[name].append(clock() - began)
    return {name: np.array(seconds) for name, seconds in out.items()}


def median_and_quartiles(ratios: Array) -> tuple[float, tuple[float, float]]:
    """The median and the lower and upper quartile of one ratio per turn."""
    low, middle, high = (float(x) for x in np.percentile(ratios, [25, 50, 75]))
    return middle, (low, high)
