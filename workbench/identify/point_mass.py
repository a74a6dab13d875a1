"""A mass that a link carries, as sizes that show linearly: moments, as mass and distance do not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from workbench.effects.base import Effect
from workbench.identify.options import FIT
from workbench.identify.parameters import Candidate, both_ways
from workbench.robot.kinematics import Kinematics
from workbench.types import Array, Mask


def point_mass(payload: Effect, link: str, k: Kinematics, base_is_held: bool) -> Candidate:
    """A payload of a link, from its centre of mass on; of one that only turns about an axis that is fixed, from that axis on."""
    center = np.asarray(k.centers.get(link, np.zeros(3)), dtype=float)
    mass, position = (p.typical for p in payload.parameters)
    if not (base_is_held and len(k.chain(link)) == 1):
        return PointMass.of(payload, (link,), (0.0, *center), (mass, *(center + position)))
    frame = k.frames[k.chain(link)[0]]
    axis = frame.axis_B / np.linalg.norm(frame.axis_B)
    on_axis = frame.p_BM + axis * (axis @ (center - frame.p_BM))
    swung = SwungMass.of(payload, (link,), (0.0, *on_axis), (mass, *(on_axis + position)))
    return replace(swung, axis=(axis[0], axis[1], axis[2]))


@dataclass(frozen=True)
class PointMass(Candidate):
    """A payload. Sizes: its mass and its moments about the link's centre of mass. It is looked at on both sides, as a vector has
    no sign."""

    def values(self, x: Sequence[float] | Array) -> list[float]:
        x = np.asarray(x, dtype=float)
        return super().values([x[0], *(x[1:] / max(x[0], FIT.least_mass))])

    def bounds(self) -> tuple[Array, Array]:
        low, high = super().bounds()
        low[1:], high[1:] = -FIT.most_moment, FIT.most_moment
        return low, high

    def seldom(self) -> Array:
        return np.full(self.size, np.nan)  # of moments it is not known

    def probes(self) -> list[Array]:
        return [np.array([1.0, *(FIT.away * np.eye(4)[k, 1:])]) for k in range(4)]

    def around(self) -> list[Array]:
        middle, *probes = self.probes()
        return [middle, *both_ways(middle, [p - middle for p in probes])]

    @property
    def makes(self) -> Mask:
        return np.arange(self.size) == 0


@dataclass(frozen=True)
class SwungMass(PointMass):
    """A payload that swings about a fixed axis (in the link's frame). Gravity tells its moments about that axis, inertia how far
    away it is; nothing tells more. Sizes: doublings of that distance, and the two moments."""

    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)

    @property
    def size(self) -> int:
        return 3

    @property
    def shapes(self) -> Mask:
        return np.array([True, False, False])

    @property
    def of_vector(self) -> Mask:
        return ~self.shapes

    @property
    def makes(self) -> Mask:
        return ~self.shapes

    def values(self, x: Sequence[float] | Array) -> list[float]:
        x = np.asarray(x, dtype=float)
        away = FIT.swung_distance * 2.0 ** float(np.clip(x[0], *FIT.swung_doublings))
        unit = self.typical[0] * (self.typical[1] - self.neutral[1])  # of moments [kg m]
        moment = unit * (x[1:] @ self._across)
        size = float(np.linalg.norm(moment))
        ahead = moment / size if size > 0 else self._across[0]
        mass, position = self.parameters[0], np.array(self.neutral[1:]) + away * ahead
        return [float(np.clip(size / away, mass.low, mass.high)), *position.tolist()]

    def bounds(self) -> tuple[Array, Array]:
        return np.array([FIT.swung_doublings[0], -FIT.most_moment, -FIT.most_moment]), np.array(
            [FIT.swung_doublings[1], FIT.most_moment, FIT.most_moment]
        )

    def probes(self) -> list[Array]:
        return [FIT.away * np.eye(3)[k] for k in (1, 2)]

    def around(self) -> list[Array]:
        return both_ways(np.zeros(3), self.probes())

    @property
    def _across(self) -> Array:
        """Two directions (2, 3) across the axis."""
        axis = np.array(self.axis)
        one = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        one /= np.linalg.norm(one)
        return np.array([one, np.cross(axis, one)])
