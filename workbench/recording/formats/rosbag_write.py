"""A recording as a bag of ROS 2 (MCAP): joint states, the goals as a joint trajectory, and bodies as transforms."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.recording.recording import Recording
from workbench.types import Array

JOINT_STATES, TRAJECTORY, TRANSFORMS = "/joint_states", "/joint_trajectory", "/tf"
FRAME = "mocap"
"""Frame of the capture system, with z up, in which bodies are given."""


def write_rosbag(recording: Recording, folder: str | Path, began: float) -> Path:
    """Writes a folder that `ros2 bag play` plays; a bag of that name is replaced, and nothing else. Angles are in rad, places in
    m with z up.

    began: time zero of the recording, in seconds since 1970 (UTC). A joint state holds the joints that were read then; a goal is
    a point of the trajectory, stamped with its start. InputError where the folder cannot be written, or is something else.
    """
    folder = Path(folder)
    if folder.exists() and not _is_bag_alone(folder):
        raise InputError(folder, "already exists and is not a bag, or holds more than one; name another folder")
    part = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    try:
        part.parent.mkdir(parents=True, exist_ok=True)
        _write(recording, part, began)
        _name_after(part, folder.name)
        if folder.exists():
            shutil.rmtree(folder)
        part.rename(folder)
    except OSError as e:
        shutil.rmtree(part, ignore_errors=True)
        raise InputError(folder, f"cannot be written ({e.strerror})") from None
    return folder


def _is_bag_alone(folder: Path) -> bool:
    """Whether a folder holds a bag's metadata and its files, and nothing else that replacing it would delete."""
    metadata = folder / "metadata.yaml"
    if not metadata.is_file() or not metadata.read_bytes()[:200].lstrip().startswith(b"rosbag2_bagfile_information"):
        return False
    return all(f == metadata or (f.is_file() and f.suffix in _BAG_FILES) for f in folder.iterdir())


def _name_after(part: Path, name: str) -> None:
    """Names the bag's file as the folder is going to be called, there and in the metadata."""
    (file,) = part.glob("*.mcap")
    metadata = part / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace(file.name, f"{name}.mcap"))
    file.rename(part / f"{name}.mcap")


def _write(recording: Recording, folder: Path, began: float) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, kind, messages in (
                (JOINT_STATES, "sensor_msgs/msg/JointState", _joint_states(recording, store.types, began)),
                (TRAJECTORY, "trajectory_msgs/msg/JointTrajectory", _trajectory(recording, store.types, began)),
                (TRANSFORMS, "tf2_msgs/msg/TFMessage", _transforms(recording, store.types, began))):
            connection = writer.add_connection(topic, kind, typestore=store) if messages else None
            for time, message in messages:
                writer.write(connection, time, store.serialize_cdr(message, kind))


_BAG_FILES = (".mcap", ".db3")
Messages = list[tuple[int, Any]]
"""Each with its time [ns since 1970]."""


def _nanoseconds(began: float, time: float) -> int:
    return round(began * 1e9) + round(float(time) * 1e9)


def _stamp(types: Any, nanoseconds: int) -> Any:
    return types["builtin_interfaces/msg/Time"](sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def _header(types: Any, nanoseconds: int, frame: str = "") -> Any:
    return types["std_msgs/msg/Header"](stamp=_stamp(types, nanoseconds), frame_id=frame)


def _joint_states(recording: Recording, types: Any, began: float) -> Messages:
    joints = [name.removeprefix("position.") for name in recording.channels if name.startswith("position.")]
    if not joints:
        return []
    table = np.column_stack([recording.channels[f"position.{joint}"] for joint in joints])
    out, none = [], np.zeros(0)
    for time, row in zip(recording.time, table):
        read = np.isfinite(row)
        if read.any():
            at = _nanoseconds(began, time)
            names = [joint for joint, there in zip(joints, read) if there]
            out.append((at, types["sensor_msgs/msg/JointState"](
                header=_header(types, at), name=names, position=row[read], velocity=none, effort=none)))
    return out


def _trajectory(recording: Recording, types: Any, began: float) -> Messages:
    """One trajectory, with a point wherever a goal changes."""
    joints = [name.removeprefix("goal.") for name in recording.channels if name.startswith("goal.")]
    if not joints:
        return []
    goals = np.column_stack([recording.channels[f"goal.{joint}"] for joint in joints])
    known = np.isfinite(goals).all(axis=1)
    time, goals = recording.time[known], goals[known]
    if not len(time):
        return []
    new = np.append(True, np.abs(np.diff(goals, axis=0)).max(axis=1) > 0)
    none, first = np.zeros(0), float(time[0])
    points = []
    for t, row in zip(time[new], goals[new]):
        after = _nanoseconds(0.0, t - first)
        points.append(types["trajectory_msgs/msg/JointTrajectoryPoint"](
            positions=row, velocities=none, accelerations=none, effort=none,
            time_from_start=types["builtin_interfaces/msg/Duration"](sec=after // 10**9, nanosec=after % 10**9)))
    at = _nanoseconds(began, first)
    return [(at, types["trajectory_msgs/msg/JointTrajectory"](header=_header(types, at), joint_names=joints, points=points))]


def _transforms(recording: Recording, types: Any, began: float) -> Messages:
    out = []
    for k, time in enumerate(recording.time):
        at = _nanoseconds(began, time)
        seen = [_transform(types, at, body, track.p[k], track.quat[k]) for body, track in recording.rigid_bodies.items()
                if np.isfinite(track.p[k]).all() and np.isfinite(track.quat[k]).all()]
        if seen:
            out.append((at, types["tf2_msgs/msg/TFMessage"](transforms=seen)))
    return out


def _transform(types: Any, at: int, body: str, p: Array, quat: Array) -> Any:
    """Rotates from the axes of recordings (y up) to ROS's (z up)."""
    vector, turn = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    w, x, y, z = map(float, quat)
    return types["geometry_msgs/msg/TransformStamped"](
        header=_header(types, at, FRAME), child_frame_id=body,
        transform=types["geometry_msgs/msg/Transform"](
            translation=vector(x=float(p[0]), y=-float(p[2]), z=float(p[1])), rotation=turn(x=x, y=-z, z=y, w=w)))
