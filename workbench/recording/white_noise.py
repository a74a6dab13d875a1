"""Estimates the noise of a signal that also moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def white_noise(values: NDArray[np.float64]) -> float:
    """Standard deviation of the white noise in values (N,), evenly spaced, NaN where unseen: white noise e has third differences
    of variance 20 e^2, a motion almost none. NaN if no four neighbours were seen."""
    with np.errstate(invalid="ignore"):
        third = np.abs(np.diff(values, n=3))
    third = third[np.isfinite(third)]
    return float(1.4826 * np.median(third) / np.sqrt(20)) if len(third) else float("nan")
