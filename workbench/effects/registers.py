"""What servos' own registers say in a log, for effects that can be read off them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from workbench.types import Array


@dataclass(frozen=True)
class Registers:
    """Readings of the servos' registers in one log, NaN where there are none. duty: by joint, (N,); voltage (N,) [V], or None."""

    duty: Mapping[str, Array]
    voltage: Array | None = None


def mean_of_logs(values: Sequence[float], least: float) -> tuple[float, float] | None:
    """Mean of the logs' values, and its standard error, at least `least`; None for fewer than two logs."""
    if len(values) < 2:
        return None
    return float(np.mean(values)), max(float(np.std(values, ddof=1) / math.sqrt(len(values))), least)
