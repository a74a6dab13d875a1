"""Which frames of a film to keep, so that its file stays small."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workbench.types import Array


def kept_keys(values: Array) -> NDArray[np.int64]:
    """Frames to keep of `values` (F, k) so that linear interpolation between them stays within 1 of the rest
    (Ramer 1972, Douglas and Peucker 1973). First and last are always kept."""
    keep = np.zeros(len(values), dtype=bool)
    keep[[0, -1]] = True
    open_spans = [(0, len(values) - 1)]
    while open_spans:
        a, b = open_spans.pop()
        if b - a < 2:
            continue
        share = np.arange(1, b - a)[:, None] / (b - a)
        off = np.abs(values[a + 1 : b] - values[a] - share * (values[b] - values[a])).max(axis=1)
        worst = int(off.argmax())
        if off[worst] > 1:
            middle = a + 1 + worst
            keep[middle] = True
            open_spans += [(a, middle), (middle, b)]
    return np.flatnonzero(keep)
