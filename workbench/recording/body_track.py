"""The path of one rigid body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BodyTrack:
    """Path of a rigid body: p (N, 3) [m] and quaternion wxyz (N, 4), continuous in sign, NaN where unseen;
    error (N,) [m] mean marker error, if known."""

    p: Array
    quat: Array
    error: Array | None = None
