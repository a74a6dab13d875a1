"""A gait in about twenty numbers: footfall pattern, foot path, and how the servos are asked for it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from types import MappingProxyType
from typing import Any

import numpy as np

from workbench.gait.legs import Leg
from workbench.types import Array, Mask

FAMILIES = MappingProxyType({
    "trot": (0.0, 0.5, 0.5, 0.0), "walk": (0.0, 0.5, 0.75, 0.25), "crawl": (0.0, 0.5, 0.75, 0.25), "bound": (0.0, 0.0, 0.5, 0.5),
    "pace": (0.0, 0.5, 0.0, 0.5),
})
"""Phase of touch-down, as a share of the cycle, of the feet front left, front right, hind left, hind right. A crawl is a walk
with at least three feet down."""
KNEES = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Which way the knees of the front and of the hind legs point: 1 back, -1 forward."""


@dataclass(frozen=True)
class GaitShape:
    """One gait. Lengths m, angles rad, shares of a cycle 0 to 1.

    family: of FAMILIES. knees: of KNEES. poses: in a cycle. frequency: cycles a second [Hz]. stride: forward, and side: to the
    left, that a foot goes back over the ground in one stance [m]; turn: by which the body turns meanwhile [rad]. duty: share of
    the cycle on the ground. lift: of the foot. crouch: of the body below neutral. nose: by which the front stands higher than the
    hind [m]. front, hind: where the feet's paths are centred, forward of neutral. spread: feet apart, outwards. sway: of the body
    to the side, with `sway_phase` of the cycle. apex: early or late swing. push: of the foot into the ground in mid stance.
    difference: stride of front feet more than hind. lag: of the hind feet's phase. lead: share of the lead over the angles that
    the inverse servo law gives. hurry: moving speed over travel by dwell. offsets: angles [rad] added to those of the foot path,
    a row of all the model's joints for each pose; empty: none.
    """

    family: str = "trot"
    knees: tuple[int, int] = (1, 1)
    poses: int = 8
    frequency: float = 2.0
    stride: float = 0.0
    side: float = 0.0
    turn: float = 0.0
    duty: float = 0.6
    lift: float = 0.02
    crouch: float = 0.04
    nose: float = 0.0
    front: float = 0.0
    hind: float = 0.0
    spread: float = 0.0
    sway: float = 0.0
    sway_phase: float = 0.0
    apex: float = 0.0
    push: float = 0.0
    difference: float = 0.0
    lag: float = 0.0
    lead: float = 0.0
    hurry: float = 1.0
    offsets: tuple[tuple[float, ...], ...] = ()

    @property
    def phases(self) -> Array:
        """Phases at which the poses arrive (poses,), as shares of the cycle; the last closes it."""
        return np.asarray((np.arange(self.poses) + 1) / self.poses)

    @property
    def period(self) -> float:
        """Duration of a cycle [s]."""
        return 1 / self.frequency

    @staticmethod
    def from_plain(content: Mapping[str, Any]) -> GaitShape:
        """The shape that a certificate holds. KeyError, TypeError or ValueError where it holds another thing."""
        known = {f.name for f in fields(GaitShape)}
        if "family" not in content or not set(content) <= known:
            raise KeyError("family")
        rows = tuple(tuple(float(a) for a in row) for row in content.get("offsets", ()))
        return GaitShape(**{**content, "knees": tuple(content["knees"]), "offsets": rows})


@dataclass(frozen=True)
class FootPath:
    """What feet should do at N phases. p: (N, F, 3) [m] of the feet's tips in the base link's frame. stance: (N, F) bool."""

    p: Array
    stance: Mask


def foot_path(shape: GaitShape, legs: Sequence[Leg], phases: Array, size: Array | float = 1.0) -> FootPath:
    """Path of each foot of a shape at phases (N,), with strides and lifts times `size`, one for each or one for all.

    On the ground a foot goes straight back at an even pace, as the body advances and turns above it; in the air it comes
    forward on half a cosine and up on half a sine. Which foot is which follows from where it is in neutral.
    """
    neutral, size = np.array([leg.neutral for leg in legs]), np.broadcast_to(size, np.shape(phases))[:, None]
    middle = neutral[:, :2].mean(axis=0)
    front, left = neutral[:, 0] > middle[0], neutral[:, 1] > middle[1]
    offset = np.array(FAMILIES[shape.family])[np.where(front, 0, 2) + np.where(left, 0, 1)] + np.where(front, 0.0, shape.lag)
    s = (np.asarray(phases)[:, None] + offset) % 1.0
    stance = s < shape.duty
    u = np.where(stance, s / shape.duty, (s - shape.duty) / (1 - shape.duty))
    late = np.where(stance, u, u + shape.apex * np.sin(np.pi * u) ** 2)
    along = size * np.where(stance, 0.5 - u, -0.5 * np.cos(np.pi * late))  # half a stride ahead to half a stride behind
    arm = neutral[:, :2] - middle
    step_x = shape.stride + np.where(front, 0.5, -0.5) * shape.difference - shape.turn * arm[:, 1]
    step_y = shape.side + shape.turn * arm[:, 0]
    up = size * np.where(stance, -shape.push * np.sin(np.pi * u), shape.lift * np.sin(np.pi * late.clip(0, 1)))
    sway = size * shape.sway * np.sin(2 * np.pi * (np.asarray(phases)[:, None] - shape.sway_phase))
    p = np.empty((*s.shape, 3))
    p[..., 0] = neutral[:, 0] + np.where(front, shape.front, shape.hind) + along * step_x
    p[..., 1] = neutral[:, 1] + np.where(left, shape.spread, -shape.spread) + along * step_y - sway
    p[..., 2] = neutral[:, 2] + shape.crouch - np.where(front, shape.nose, -shape.nose) / 2 + up
    return FootPath(p, stance)
