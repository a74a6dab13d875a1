"""Observation of a run by a motion capture system (OptiTrack)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from studies.other_engine.player import Rollout
from workbench.types import Array

_AXES = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From the robot's world (x forward, y left, z up) to the capture's (x forward, y up, z right)."""


@dataclass(frozen=True)
class Camera:
    """How the robot is looked at, one session long.

    rate [Hz]; rotation_noise about each axis [rad] and position_noise along each axis [m], standard deviations; yaw of
    the robot's first heading in the capture's axes, positive to the left [rad]; origin (3,): of the robot's world in
    the capture's axes [m]; gaps: mean number of gaps of each rigid body per take.
    """

    rate: float = 120.0
    rotation_noise: float = float(np.deg2rad(0.12))
    position_noise: float = 1e-4
    yaw: float = 0.0
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gaps: float = 0.0

    def noiseless(self) -> Camera:
        """The same place, without noise and gaps."""
        return Camera(self.rate, 0.0, 0.0, self.yaw, self.origin, 0.0)


@dataclass(frozen=True)
class Capture:
    """Rigid bodies by asset in the capture's axes: p (N, 3) [m], quat (N, 4) x y z w, error (N,) [m]; NaN where unseen.

    starts_at: time of the first command, from the first frame [s].
    """

    rate: float
    starts_at: float
    p: Mapping[str, Array]
    quat: Mapping[str, Array]
    error: Mapping[str, Array]

    def __len__(self) -> int:
        return len(next(iter(self.p.values())))

    def cut(self, frames: int) -> Capture:
        """The first frames alone."""
        start = ({k: v[:frames] for k, v in channel.items()} for channel in (self.p, self.quat, self.error))
        return Capture(self.rate, self.starts_at, *start)


def pivots_for(
    rollout: Rollout, rigid_bodies: Mapping[str, str], rng: np.random.Generator, spread: float = 0.012
) -> dict[str, Array]:
    """A pivot for each asset, in its link's frame [m]: somewhere within `spread` of the link's centre of mass."""
    return {a: rollout.model.body(link).ipos + rng.uniform(-spread, spread, 3) for a, link in rigid_bodies.items()}


def film(
    rollout: Rollout, rigid_bodies: Mapping[str, str], pivots: Mapping[str, Array], camera: Camera, starts_at: float,
    rng: np.random.Generator, frames_turned: Mapping[str, Array] | None = None,
) -> Capture:
    """Frames from `starts_at` [s] before the first command to the run's end.

    The frame of a rigid body is its link's, turned so that at rest before the first command it is parallel to the
    capture's axes; frames_turned: asset -> rotation vector (3,) [rad] in its frame by which it is turned from that.
    ValueError if the run rests for less than `starts_at`.
    """
    if -rollout.time[0] < starts_at:
        raise ValueError(f"expected a run that rests for {starts_at} s, got {-rollout.time[0]} s")
    frames = int(np.floor((rollout.time[-1] + starts_at) * camera.rate)) + 1
    time = np.arange(frames) / camera.rate - starts_at
    links = tuple(dict.fromkeys(rigid_bodies.values()))
    poses, rest = rollout.poses(time, links), rollout.poses(np.zeros(1), links)
    c, s = np.cos(camera.yaw), np.sin(camera.yaw)
    to_capture = _AXES @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    p, quat, error = {}, {}, {}
    for asset, link in rigid_bodies.items():
        p_WL, R_WL = poses[link]
        turned = to_capture @ (R_WL @ rest[link][1][0].T) @ to_capture.T
        if frames_turned and asset in frames_turned:
            turned = turned @ Rotation.from_rotvec(frames_turned[asset]).as_matrix()
        noise = Rotation.from_rotvec(camera.rotation_noise * rng.standard_normal((frames, 3)))
        q = (noise * Rotation.from_matrix(turned)).as_quat(canonical=True)
        x = (p_WL + R_WL @ pivots[asset]) @ to_capture.T + camera.origin
        x += camera.position_noise * rng.standard_normal((frames, 3))
        e = np.abs(1.2e-4 + 0.25e-4 * rng.standard_normal(frames))
        unseen = _gaps(frames, camera.gaps, rng)
        q[unseen], x[unseen], e[unseen] = np.nan, np.nan, np.nan
        p[asset], quat[asset], error[asset] = x, q, e
    return Capture(camera.rate, starts_at, p, quat, error)


def _gaps(frames: int, mean: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Frames in which a body is hidden: a few stretches of up to a quarter of a second, after the first half second."""
    unseen = np.zeros(frames, dtype=bool)
    for _ in range(rng.poisson(mean)):
        start = rng.integers(60, max(61, frames))
        unseen[start : start + rng.integers(2, 31)] = True
    return unseen
