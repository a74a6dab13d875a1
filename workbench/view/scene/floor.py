"""What lies on the floor of a 3D replay: its grid, and the paths of the robots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Meshcat, Rgba

from workbench.types import Array
from workbench.view.scene.keyframes import kept_keys

GRID = 0.05
"""Spacing of the lines on the floor [m]; every tenth is darker."""


def add_grid(meshcat: Meshcat, low: Array, high: Array) -> None:
    """Lines every GRID between two corners (2,) [m]."""
    lines: dict[str, list[tuple[Array, Array]]] = {"fine": [], "coarse": []}
    low, high = np.floor(low / GRID) * GRID, np.ceil(high / GRID) * GRID
    for axis in (0, 1):
        for k in range(round(low[axis] / GRID), round(high[axis] / GRID) + 1):
            a, b = np.array([*low, 0.0]), np.array([*high, 0.0])
            a[axis] = b[axis] = k * GRID
            lines["coarse" if k % 10 == 0 else "fine"].append((a, b))
    for name, grey in (("fine", 0.8), ("coarse", 0.45)):
        if lines[name]:
            start, end = (np.array(x, dtype=float).T for x in zip(*lines[name], strict=True))
            meshcat.SetLineSegments(f"/floor/{name}", np.asfortranarray(start), np.asfortranarray(end), 1.0,
                                    Rgba(grey, grey, grey, 1.0))


def ribbon(path: Array, width: float) -> tuple[Array, NDArray[np.int32]] | None:
    """A path (F, 2) [m] as triangles on the floor, as WebGL draws lines one pixel wide; None if it stays in place."""
    path = path[kept_keys(path / 0.0005)]
    path = path[np.concatenate([[True], np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-4])]
    if len(path) < 2:
        return None
    along = np.gradient(path, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    side = 0.5 * width * np.column_stack([-along[:, 1], along[:, 0]])
    n = len(path)
    vertices = np.column_stack([np.vstack([path + side, path - side]), np.full(2 * n, 0.001)])
    a = np.arange(n - 1)
    faces = np.hstack([np.vstack([a, a + n, a + 1]), np.vstack([a + 1, a + n, a + n + 1])])
    return np.asfortranarray(vertices.T), np.asfortranarray(faces.astype(np.int32))
