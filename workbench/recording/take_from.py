"""Makes a take from a recording and its measurement."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.recording import quaternions as quat
from workbench.recording.body_track import BodyTrack
from workbench.recording.joint_names import named_by_model
from workbench.recording.mocap.angles import angle_sigma, base_row, in_world, joint_angles
from workbench.recording.mocap.mending import repaired
from workbench.recording.mocap.tracks import Tracks, check_assets
from workbench.recording.recording import Measurement, Recording
from workbench.recording.take import Take
from workbench.robot import RobotModel


def take_from_recording(recording: Recording, measurement: Measurement, model: RobotModel, name: str | None = None,
                        base: str = "free") -> Take:
    """The take: joint angles with their uncertainty, base and bodies in the take's world, with damage repaired, marked and
    reported.

    The world W has x along the robot's first heading, y left, z up; its origin lies under the base link's origin at rest, on the
    capture's floor. InputError if an asset is not a link of the model, a recording has no rigid bodies, or a log's joints are not
    the model's.
    """
    label = name or Path(recording.source).stem
    if recording.sensing == "mocap":
        check_assets(recording, model)
        take = take_from_tracks(repaired(recording, model), measurement, model, label, base)
        return replace(take, problems=(*recording.problems, *take.problems))
    return _take_of_log(recording, measurement, model, label, base)


def take_from_tracks(tracks: Tracks, measurement: Measurement, model: RobotModel, name: str, base: str) -> Take:
    """The same as `take_from_recording`, from repaired tracks."""
    m = measurement
    angles = joint_angles(tracks, model, m.yaw, base)
    noise = np.array([m.noise.get(j, np.nan) for j in angles.joints])
    p, q = in_world(tracks, m.yaw, m.origin)
    p_WB = quat_WB = None
    root = base_row(tracks, model)
    if root is not None:
        pivot = np.asarray(m.pivots.get(tracks.assets[root], np.zeros(3)))
        quat_WB = q[root]
        rotation = quat.matrix(quat.multiply(quat_WB, m.rest_rotation))
        p_WB = p[root] - rotation @ pivot
    return Take(
        name=name, source="recording", time=tracks.time, joints=angles.joints, q=angles.q, starts_at=m.starts_at, zeroed=True,
        base=base, q_sigma=angle_sigma(angles, noise, tracks.rate), p_WB=p_WB, quat_WB=quat_WB, off_axis=angles.off_axis,
        bodies={a: BodyTrack(p[i], q[i]) for i, a in enumerate(tracks.assets)}, mended=tracks.mended,
        problems=(*tracks.problems, *angles.problems))


def _take_of_log(recording: Recording, measurement: Measurement, model: RobotModel, name: str, base: str) -> Take:
    """A servo log's positions are the servo's own angles: not zeroed, noise from its resolution."""
    recording = named_by_model(recording, model)
    commands = recording.commands
    if commands is None:
        raise InputError(recording.source, "holds several programmes; choose one as FILE#PROGRAMME")
    joints = tuple(j for j in model.joints if f"position.{j}" in recording.channels)
    if not joints:
        raise InputError(recording.source, "expected a position of at least one joint")
    q = np.column_stack([recording.channels[f"position.{j}"] for j in joints])
    v = None
    if all(f"velocity.{j}" in recording.channels for j in joints):
        v = np.column_stack([recording.channels[f"velocity.{j}"] for j in joints])
    sigma = np.array([measurement.noise.get(j, np.nan) for j in joints])
    return Take(name=name, source="recording", time=recording.time, joints=joints, q=q, v=v, starts_at=measurement.starts_at,
                base=base, q_sigma=np.where(np.isfinite(q), sigma, np.nan), commands=commands.reordered(model.joints),
                problems=recording.problems)
