"""Finds how the cameras observed the robot (start, yaw, origin and pivots, nothing else) from its rest and first motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench.files import InputError
from workbench.motion.commands import Commands
from workbench.recording import quaternions as quat
from workbench.recording.joint_names import named_by_model
from workbench.recording.mocap.angles import Angles, joint_angles
from workbench.recording.mocap.mending import repaired
from workbench.recording.mocap.pivots import base_origin, find_pivots
from workbench.recording.mocap.start import StartEstimate, find_start, lagged_reference
from workbench.recording.mocap.tracks import Tracks, capture_axes, check_assets
from workbench.recording.mocap.yaw import YawEstimate, yaw_of
from workbench.recording.recording import Measurement, Recording
from workbench.recording.servo_log.state import count_of, count_that_stays, first_command, resolution, staying
from workbench.recording.take import Take
from workbench.recording.white_noise import white_noise
from workbench.robot import RobotModel
from workbench.types import Array, Mask

_SETTLED = 0.02  # [s] before the start that do not count as rest
_FEW = 5  # with fewer frames of rest the noise is not taken from them


@dataclass(frozen=True)
class _Rest:
    pose: Mapping[str, float]
    rotation: Array


def register(recording: Recording, model: RobotModel, commands: Commands | None, predicted: Take | None = None,
             starts_at: float | None = None, yaw: float | None = None, base: str = "free") -> Measurement:
    """Finds how the cameras observed the robot. predicted: a simulated take of the same commands; if it is not zeroed, the
    recorded zeros are taken to mean the pose and tilt in which it rests. Without it, the commands passed through a lag are used.
    starts_at [s], yaw [rad]: known values, which are then not estimated (the yaw of a session: `session_yaw`). base: "free" or
    "fixed". The clock rate is taken as 1, and marker frames as stated. Logs have their own commands and clock. InputError if no
    start can be found.
    """
    if recording.sensing == "encoders":
        return _register_log(recording, model, starts_at)
    check_assets(recording, model)
    tracks = repaired(recording, model)
    heading = YawEstimate(yaw, float("nan"), {}) if yaw is not None else yaw_of([tracks], model, [commands], base)
    angles = joint_angles(tracks, model, heading.yaw, base)
    start = _start(recording, tracks, angles, commands, predicted, starts_at)
    resting = tracks.time < start.time - _SETTLED
    rest = _rest_of(predicted)
    found = find_pivots(tracks, angles, model, heading.yaw, rest.pose, rest.rotation)
    return Measurement(
        starts_at=start.time, starts_at_sigma=start.sigma, joint_starts=start.by_joint, yaw=heading.yaw, yaw_sigma=heading.sigma,
        origin=base_origin(tracks, model, heading.yaw, found.pivots, resting, rest.rotation),
        pivots=found.pivots, pivot_sigma=found.sigma,
        rest=_rest_poses(tracks, resting),
        noise=dict(zip(angles.joints, noise_at_rest(angles.q, resting & ~tracks.mended))),
        position_noise=_position_noise(tracks, resting), rest_pose=rest.pose, rest_rotation=rest.rotation)


def _register_log(recording: Recording, model: RobotModel, starts_at: float | None) -> Measurement:
    """A log's clock is its own; SAGE's first command may come before or after the first measurement."""
    recording = named_by_model(recording, model)
    positions = {j: recording.channels[f"position.{j}"] for j in model.joints if f"position.{j}" in recording.channels}
    counts: dict[str, float] = {}  # servos of one kind have equal counts
    steps: dict[str, float] = {}  # for servos that never move and so do not show their count
    rests: dict[str, list[Array]] = {}  # for servos that rest at few positions
    for joint, position in positions.items():
        kind = model.servo(joint).model
        counts[kind] = float(np.fmin(counts.get(kind, np.nan), count_that_stays(position)))
        steps[kind] = min(steps.get(kind, np.inf), resolution(position) or np.inf)
        rests.setdefault(kind, []).append(staying(position))
    for kind, values in rests.items():
        counts[kind] = float(np.fmax(counts[kind], count_of(np.concatenate(values))))
    noise = {}
    for joint, position in positions.items():
        still = noise_at_rest(position[:, None], np.zeros(len(position), dtype=bool))[0]
        kind = model.servo(joint).model
        own = resolution(position) or (steps[kind] if np.isfinite(steps[kind]) else 0.0)
        count = np.fmax(own, counts[kind])
        noise[joint] = float(np.fmax(still, count / np.sqrt(12)))
    return Measurement(starts_at=first_command(recording, starts_at), noise=noise)


def _start(recording: Recording, tracks: Tracks, angles: Angles, commands: Commands | None, predicted: Take | None,
           starts_at: float | None) -> StartEstimate:
    if starts_at is not None:
        return StartEstimate(starts_at, 0.0, {})
    if predicted is None:
        if commands is None:
            raise InputError(recording.source, "start: expected commands or starts_at, to know when the motion begins")
        predicted = lagged_reference(commands)
    noise = noise_at_rest(angles.q, np.zeros(len(angles.q), dtype=bool))
    return find_start(tracks.time, angles.joints, angles.q, noise, predicted.zeroed_at_rest())


def noise_at_rest(q: Array, resting: Mask) -> Array:
    """Standard deviation (n,) [rad] of columns q (N, n) about their mean at rest; if there is too little rest, their white noise
    over the whole recording."""
    out = np.full(q.shape[1], np.nan)
    for c in range(q.shape[1]):
        rest = q[resting, c][np.isfinite(q[resting, c])]
        out[c] = rest.std(ddof=1) if len(rest) >= _FEW else white_noise(q[:, c])
    return out


def _position_noise(tracks: Tracks, resting: Mask) -> float:
    if resting.sum() < _FEW:
        return float("nan")
    p = tracks.p[:, resting & ~tracks.mended]
    seen = np.isfinite(p).all(axis=-1).sum(axis=1) >= _FEW
    return float(np.sqrt(np.mean(np.nanvar(p[seen], axis=1, ddof=1)))) if seen.any() else float("nan")


def _rest_poses(tracks: Tracks, resting: Mask) -> dict[str, tuple[Array, Array]]:
    out = {}
    for i, asset in enumerate(tracks.assets):
        at = tracks.seen[i] & resting
        if not at.any():
            at = tracks.seen[i] & (np.cumsum(tracks.seen[i]) == 1)
        if at.any():
            q = quat.mean(tracks.q[i, at])
            out[asset] = capture_axes(tracks.p[i, at].mean(axis=0)), np.concatenate([q[:1], capture_axes(q[1:])])
    return out


def _rest_of(predicted: Take | None) -> _Rest:
    """The pose in which a simulated take rests; neutral and level if unknown."""
    level = np.array([1.0, 0, 0, 0])
    if predicted is None or predicted.zeroed or not predicted.resting.any():
        return _Rest({}, level)
    q = predicted.q[predicted.resting].mean(axis=0)
    turn = level if predicted.quat_WB is None else quat.mean(predicted.quat_WB[predicted.resting])
    return _Rest(dict(zip(predicted.joints, q.tolist())), turn)

