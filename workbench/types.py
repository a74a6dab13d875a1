"""Types that the whole package shares."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers; shape, units and frame are given where one is used."""
Mask = NDArray[np.bool_]
"""One truth value per entry of an array."""
Progress = Callable[[str, float | None], None]
"""Called with the current stage of the work and its share done, 0 to 1 (None: unknown)."""


def no_progress(what: str, done: float | None = None) -> None:
    """Reports nothing; the default of functions that take a `Progress`."""
