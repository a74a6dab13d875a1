"""Which velocities are on the way of which to the root, and where limbs join."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.simulation.compiled.arrays import Ints, Numbers


def ways(path: Ints, base: int) -> dict[str, Any]:
    """`Tree.depth` to `Tree.joined`. base: velocities of a free base."""
    n = len(path)
    on_way: list[list[int]] = []
    for k, before in enumerate(path):
        on_way.append([*(on_way[before] if before >= 0 else ()), k])
    depth = np.array([len(way) - 1 for way in on_way], dtype=np.uint32)
    above = np.zeros((n, int(depth.max(initial=0)) + 1), dtype=np.uint32)
    for k, way in enumerate(on_way):
        above[k, :len(way)] = way
    number = np.arange(n, dtype=np.uint32)
    ends = np.bincount(path[path >= 0], minlength=n) == 0
    forks = {j for j in range(n) if sum(j in way for way, end in zip(on_way, ends) if end) > 1} | set(range(base))
    inner = np.array([sum(j in forks for j in way[:-1]) for way in on_way], dtype=np.uint32)
    order = base + np.argsort(depth[base:], kind="stable").astype(np.uint32)
    return {"depth": depth, "above": above, "number": number, "every": np.tile(number, (n, 1)), "inner": inner, "order": order,
            "forks": np.array([k in forks for k in range(n)]),
            "limbs": np.array([k for k in order if int(k) not in forks], dtype=np.uint32),
            "joined": np.array([k for k in range(base, n) if inner[k] > base or k in forks], dtype=np.uint32)}


def groups(path: Ints) -> Numbers:
    """Trees of Drake's forest: velocities with a common end of their paths."""
    group = np.empty(len(path), np.uint32)
    trees = 0
    for k, before in enumerate(path):
        group[k] = trees if before < 0 else group[before]
        trees += int(before < 0)
    return group
