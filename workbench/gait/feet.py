"""The feet of a simulated gait: slip, clearance, and the margin against tipping over."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from workbench.gait.legs import Leg
from workbench.recording import quaternions
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.types import Array, Mask

TOUCHING = 1e-3
"""Height of a foot's lowest point [m], above that at rest, below which it carries load: there points of 1e4 N/m yield by 0.3 mm,
loaded twice as much by another 0.3 mm."""


@dataclass(frozen=True)
class FeetMeasure:
    """slip: mean speed over the ground [m/s] of the points at which feet touch it, from row to row. clearance: the
    least over feet and cycles of how high a foot comes [m]. tipping: least angle [rad] between the base's tilt and that at which
    the middle between the neutral feet carries the centre of mass over their edge."""

    slip: float
    clearance: float
    tipping: float


def feet_measure(take: Take, model: RobotModel, legs: tuple[Leg, ...], begin: float, period: float, end: float = math.inf,
                 ) -> FeetMeasure:
    """Measures of the feet in a free take from `begin` [s] to `end` [s], in whole cycles of `period` [s]; tipping over the whole
    take. Positions of feet are from the model's kinematics; for a tilted foot its lowest point counts."""
    height, speed = _lowest(take, model, legs)  # speed (N-1, F), between rows
    inside = (take.time >= begin - 1e-9) & (take.time <= end + 1e-9)
    z = height - _floor(height, take.time < 0)
    down = (z < TOUCHING) & inside[:, None]
    stays = down[1:] & down[:-1]  # a foot that lands between two rows has not slipped
    cycles = range(max(int((min(float(take.time[-1]), end) - begin) / period + 1e-6), 1))
    tops = [z[(take.time >= begin + k * period - 1e-9) & (take.time < begin + (k + 1) * period)].max(axis=0) for k in cycles]
    return FeetMeasure(slip=float(speed[stays].mean()) if stays.any() else float("nan"),
                       clearance=float(np.min(tops)), tipping=_tipping_angle(model, legs) - _tilt(take))


def _lowest(take: Take, model: RobotModel, legs: tuple[Leg, ...]) -> tuple[Array, Array]:
    """Height and speed of each foot's lowest point: its height in W (N, F) [m], and the speed along the ground (N-1, F) [m/s] at
    which the point of the link that touches there moves until the next row; a foot that rolls does not slip."""
    assert take.p_WB is not None
    assert take.quat_WB is not None
    poses, R_WB = model.kinematics.forward(take.q, take.joints), quaternions.matrix(take.quat_WB)
    height, speed = np.empty((len(take), len(legs))), np.empty((len(take) - 1, len(legs)))
    for i, leg in enumerate(legs):
        p, R = poses[leg.link]
        R_WL = R_WB @ R
        p_W = (take.p_WB + np.einsum("nij,nj->ni", R_WB, p))[:, None] + leg.spheres @ np.swapaxes(R_WL, 1, 2)
        z = p_W[..., 2] - leg.radii
        rows, low = np.arange(len(take)), np.argmin(z, axis=1)
        height[:, i] = z[rows, low]
        moved = p_W[1:][rows[:-1], low[:-1]] - p_W[:-1][rows[:-1], low[:-1]]  # of the sphere's middle
        down = np.swapaxes(R_WL[:-1], 1, 2)[..., 2]  # vertical in the link's frame
        turned = np.einsum("nij,nj->ni", R_WL[1:], down)[:, :2]  # where that vertical points next
        moved = moved[:, :2] - np.broadcast_to(leg.radii, z.shape)[rows[:-1], low[:-1], None] * turned
        speed[:, i] = np.linalg.norm(moved, axis=1) / np.diff(take.time)
    return height, speed


def _floor(z: Array, resting: Mask) -> Array:
    """Height at which each foot stands (F,) [m] before the first command; without such frames, the lowest it ever is."""
    return np.asarray(np.median(z[resting], axis=0) if resting.any() else z.min(axis=0))


def _tilt(take: Take) -> float:
    assert take.quat_WB is not None
    _, x, y, _ = take.quat_WB.T
    return float(np.arccos(np.clip((1 - 2 * (x * x + y * y)).min(), -1, 1)))


def _tipping_angle(model: RobotModel, legs: tuple[Leg, ...]) -> float:
    """Tilt [rad] about the nearest edge of the neutral feet's rectangle at which the centre of mass is above it."""
    k = model.kinematics
    poses = k.forward(np.zeros((1, len(k.joints))))
    com = sum(k.masses[link] * (p[0] + R[0] @ k.centers[link]) for link, (p, R) in poses.items()) / k.mass
    feet = np.array([leg.neutral for leg in legs])
    reach = np.minimum(feet.max(axis=0) - com, com - feet.min(axis=0))[:2].min()
    return float(np.arctan2(reach, com[2] - feet[:, 2].min()))
