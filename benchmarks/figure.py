"""A measured figure beside what is required of it, and how it is measured: in turns, so that a busy machine slows both sides."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from workbench.types import Array


@dataclass(frozen=True)
class Figure:
    """value: of what `meaning` says, the median over turns, quartiles beside it; None with the reason where it was `skipped`.
    at_least, below: what is required of it, if anything is; aim: what is hoped for. details: what stands behind it."""

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
        """Plain data; what does not apply is left out."""
        requirement = {"at_least": self.at_least, "below": self.below, "aim": self.aim}
        out = {"meaning": self.meaning, "value": self.value, "quartiles": self.quartiles and list(self.quartiles),
               "requirement": {k: v for k, v in requirement.items() if v is not None} or None, "met": self.met,
               "details": dict(self.details) or None, "skipped": self.skipped}
        return {k: v for k, v in out.items() if v is not None}


def in_turns(runs: Mapping[str, Callable[[], object]], repeats: int, clock: Callable[[], float] = time.process_time,
             warm: bool = True) -> dict[str, Array]:
    """Seconds (repeats,) that each run takes, one after the other in each turn; once before, untimed, to warm up.

    clock: processor time of this process, which other processes disturb least, or time.perf_counter for work that is done
    by several processes or threads.
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
    """Of the ratios of all turns."""
    low, middle, high = (float(x) for x in np.percentile(ratios, [25, 50, 75]))
    return middle, (low, high)
