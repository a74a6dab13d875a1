"""A simulated robot as the thesis's cameras would have recorded it, read and registered as any recording is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.recording import quaternions as quat
from workbench.recording.body_track import BodyTrack
from workbench.recording.mocap.observe import observe
from workbench.recording.mocap.registration import register
from workbench.recording.recording import Measurement, Recording
from workbench.recording.take import Take
from workbench.recording.take_from import take_from_recording
from workbench.robot import RobotModel

Array = NDArray[np.float64]

RATE = 120.0
ROTATION_NOISE, POSITION_NOISE = float(np.radians(0.12)), 1e-4
"""Standard deviations about and along each axis of each of the 14 rigid bodies [rad, m]."""
REST = 0.4871
"""Time of the first command on the recording's clock [s]: it falls between two frames."""
YAW = float(np.radians(7.0))
"""The robot's first heading in the capture's axes, positive to the left: nobody puts it down quite straight."""


@dataclass(frozen=True)
class Recorded:
    """One run as recorded. take: registered, on the recording's clock. measurement: how it was looked at, as registration found
    it. recording: the rigid bodies in the capture's axes."""

    recording: Recording
    measurement: Measurement
    take: Take

    def view(self, rollout: Take, model: RobotModel) -> Take:
        """A rollout as this recording's cameras would have shown it, without noise."""
        return observe(rollout, self.measurement, model, self.take.time)[0]


def film(rollout: Take, model: RobotModel, seconds: float, seed: int, yaw: float = YAW) -> Recording:
    """What the cameras write of a rollout: every rigid body that they know, `seconds` from the first command on.

    model: the nominal robot (names and rigid bodies). Frames lie anywhere on their links, the same in every recording.
    """
    where = np.random.default_rng(0)
    pivots = {asset: where.uniform(-0.012, 0.012, 3) for asset in model.rigid_bodies}
    how = Measurement(starts_at=REST, yaw=yaw, origin=np.array([0.13, -0.21, 0.16]), pivots=pivots)
    frames = np.arange(int((REST + seconds) * RATE) + 1)
    noise = np.random.default_rng(seed)
    _, bodies = observe(rollout, how, model, frames / RATE)
    seen = {asset: _noisy(body, noise) for asset, body in bodies.items()}
    return Recording(rollout.name, "motive", "1.23", frames / RATE, frames, RATE, rigid_bodies=seen, sensing="mocap")


def record(rollout: Take, model: RobotModel, seconds: float, predicted: Take, seed: int = 1, yaw: float = YAW) -> Recorded:
    """Films a rollout and registers what comes of it against `predicted`, the rollout of what one believes. The base is
    held where the rollout's was."""
    recording = film(rollout, model, seconds, seed, yaw)
    commands = predicted.commands
    measurement = register(recording, model, commands, predicted, base=rollout.base)
    take = take_from_recording(recording, measurement, model, rollout.name, rollout.base)
    return Recorded(recording, measurement, replace(take, commands=commands))


def _noisy(body: BodyTrack, noise: np.random.Generator) -> BodyTrack:
    turn = ROTATION_NOISE * noise.standard_normal(body.p.shape)
    angle = np.linalg.norm(turn, axis=1)
    shaken = np.column_stack([np.cos(angle / 2), turn * (np.sin(angle / 2) / angle)[:, None]])
    return BodyTrack(body.p + POSITION_NOISE * noise.standard_normal(body.p.shape), quat.multiply(shaken, body.quat))
