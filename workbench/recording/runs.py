"""Runs of a recording's rows: neighbours that share a property, or a value."""

from __future__ import annotations

import numpy as np

from workbench.types import Array, Mask


def runs_of_true(mask: Mask) -> list[tuple[int, int]]:
    """First index, and the one after the last, of each run of True in a mask (N,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def runs_of_equals(values: Array) -> list[tuple[int, int]]:
    """First and last index of each run of two or more equal values (N,)."""
    return runs_of_true(values[1:] == values[:-1])
