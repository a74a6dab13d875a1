"""Rough ground: a field of boxes of random height on the level floor, as a robot meets on cobbles, mats and cables."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Box, ProximityProperties, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant

TILE = 0.08
"""Side of a box [m]: half the distance between the puppy's front and hind feet, so that its feet stand on different ones."""
FIELD = ((-0.4, 2.0), (-0.64, 0.64))
"""Where there are boxes, x and y [m]: four seconds of its fastest gait, with room to stray; beyond it the floor is level. Drake's
time to build such a field grows with the square of the number of boxes."""
CLEAR = 0.2
"""Radius around the start [m] without boxes, so that the robot stands level before the first command."""
DEPTH = 0.02
"""Depth of the boxes below the floor [m], so that there are no gaps."""


def AddBoxes(plant: MultibodyPlant, scene_graph: SceneGraph, tallest: float, seed: int) -> None:
    """Boxes of random heights, even up to `tallest` [m], of the ground's material, the same for the same seed. Call after the
    ground is there, before Finalize."""
    ground = plant.GetCollisionGeometriesForBody(plant.world_body())[-1]
    properties = ProximityProperties(scene_graph.model_inspector().GetProximityProperties(ground))
    rng = np.random.default_rng([seed, 30])
    (x0, x1), (y0, y1) = FIELD
    for i, x in enumerate(np.arange(x0 + TILE / 2, x1, TILE)):
        for j, y in enumerate(np.arange(y0 + TILE / 2, y1, TILE)):
            height = float(tallest * rng.uniform())
            if np.hypot(x, y) >= CLEAR:
                place = RigidTransform([x, y, (height - DEPTH) / 2])
                shape = Box(TILE, TILE, height + DEPTH)
                plant.RegisterCollisionGeometry(plant.world_body(), place, shape, f"box_{i}_{j}", properties)
