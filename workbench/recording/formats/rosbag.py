"""Bags of ROS 1 and ROS 2 (rosbag, SQLite, MCAP), read with the package rosbags: goals and positions of joints, else poses of
bodies."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.files.kinds import kind_of_file
from workbench.files.tables import plain_head
from workbench.recording.formats.capture_table import Capture, recording_of
from workbench.recording.formats.log_commands import commands_of_rows
from workbench.recording.formats.numbers import rate_of
from workbench.recording.formats.registry import RecordingFormat
from workbench.recording.recording import Recording
from workbench.types import Array

Samples = dict[str, list[tuple[float, float]]]
"""Times [s] and angles [rad] by joint."""
Pose = tuple[float, list[float], list[float]]
_GOAL_WORDS = ("command", "cmd", "goal", "target", "desired", "reference", "setpoint")
_BEGINNINGS = (b"\x89MCAP0\r\n", b"#ROSBAG V", b"SQLite format 3\0")
_DAMAGED = (OSError, ValueError, KeyError, RuntimeError, IndexError, AssertionError, AttributeError, TypeError, EOFError)


def matches(head: bytes) -> bool:
    """Recognised by its first bytes."""
    return head.startswith(_BEGINNINGS)


def read_rosbag(path: Path) -> Recording:
    """Reads the joints of which the bag has goals and positions: a controller's state, or joint states and a separate topic of
    goals (JointState or JointTrajectory); else the poses of bodies (tf, PoseStamped, TransformStamped, Odometry; z up).

    Times are the messages' own stamps. InputError lists the topics where neither exists, and reports a damaged bag.
    """
    source = str(path)
    called = None if path.is_dir() else kind_of_file(plain_head(path))
    name = called.name if called else "a bag of ROS 2"
    found = _Found()
    try:
        found.read(path)
    except InputError:
        raise
    except Exception as e:
        if not isinstance(e, _DAMAGED) and not type(e).__module__.startswith("rosbags"):
            raise
        raise InputError(source, f"{name} (rosbag) that is damaged or of another kind: "
                                 f"{' '.join(str(e).split())[:200]}") from None
    joints = [j for j in found.goals if j in found.positions]
    if joints:
        return _joint_recording(source, found, joints)
    if found.poses:
        return _pose_recording(source, found)
    topics = ", ".join(f"{t} ({k})" for t, k in list(found.topics.items())[:8]) or "none"
    lacks = "positions of joints but no goals of theirs" if found.positions else "neither joints nor poses"
    raise InputError(source, f"{name} (rosbag) with {lacks}; topics: {topics}; expected a controller's state, joint states "
                             f"with a "
                             "topic of goals, or poses of bodies")


class _Found:
    """Content of a bag, collected message by message."""

    def __init__(self) -> None:
        self.topics: dict[str, str] = {}
        self.goals: Samples = {}
        self.positions: Samples = {}
        self.poses: dict[str, list[Pose]] = {}

    def read(self, path: Path) -> None:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            wanted = []
            for connection in reader.connections:
                kind = connection.msgtype.replace("/msg/", "/")
                self.topics[connection.topic] = kind
                if kind.rpartition("/")[2] in _TAKES:
                    wanted.append(connection)
            for connection, nanoseconds, raw in reader.messages(connections=wanted) if wanted else ():
                message = reader.deserialize(raw, connection.msgtype)
                _TAKES[connection.msgtype.rpartition("/")[2]](self, connection.topic, _stamp(message, nanoseconds), message)


def _stamp(message: Any, nanoseconds: int) -> float:
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    own = 0.0 if stamp is None else stamp.sec + 1e-9 * stamp.nanosec
    return own or 1e-9 * nanoseconds


def _add(to: Samples, names: Iterable[str], time: float, values: Iterable[float]) -> None:
    for name, value in zip(names, values):
        to.setdefault(str(name), []).append((time, float(value)))


def _joint_state(found: _Found, topic: str, time: float, message: Any) -> None:
    goal = any(word in topic.lower() for word in _GOAL_WORDS)
    _add(found.goals if goal else found.positions, message.name, time, message.position)


def _controller_state(found: _Found, topic: str, time: float, message: Any) -> None:
    for to, fields in ((found.goals, ("reference", "desired")), (found.positions, ("feedback", "actual"))):
        for field in fields:
            point = getattr(message, field, None)
            if point is not None and len(point.positions):
                _add(to, message.joint_names, time, point.positions)
                break


def _trajectory(found: _Found, topic: str, time: float, message: Any) -> None:
    for point in message.points:
        after = point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec
        _add(found.goals, message.joint_names, time + after, point.positions)


def _place(found: _Found, body: str, time: float, p: Any, q: Any) -> None:
    found.poses.setdefault(body, []).append((time, [p.x, p.y, p.z], [q.w, q.x, q.y, q.z]))


def _pose(found: _Found, topic: str, time: float, message: Any) -> None:
    pose = getattr(message.pose, "pose", message.pose)  # odometry nests the pose in one with covariance
    _place(found, topic.strip("/").removesuffix("/pose").rpartition("/")[2], time, pose.position, pose.orientation)


def _transform(found: _Found, topic: str, time: float, message: Any) -> None:
    _place(found, message.child_frame_id, time, message.transform.translation, message.transform.rotation)


def _transforms(found: _Found, topic: str, time: float, message: Any) -> None:
    for one in message.transforms:
        if one.header.frame_id.strip("/") in ("world", "map", "mocap", "odom") and not topic.endswith("static"):
            _transform(found, topic, _stamp(one, round(time * 1e9)), one)


_TAKES = {"JointState": _joint_state, "JointTrajectoryControllerState": _controller_state, "JointTrajectory": _trajectory,
          "PoseStamped": _pose, "PoseWithCovarianceStamped": _pose, "Odometry": _pose, "TransformStamped": _transform,
          "TFMessage": _transforms}
"""Reader of each type of message."""


def _sort(samples: list[tuple[float, float]]) -> tuple[Array, Array]:
    table = np.array(samples)
    times, rows = np.unique(table[:, 0], return_index=True)
    return times, table[rows, 1]


def _joint_recording(source: str, found: _Found, joints: list[str]) -> Recording:
    """On the clock of the positions; a goal holds until the next."""
    clocks = {j: _sort(found.positions[j]) for j in joints}
    time = clocks[joints[0]][0]
    channels: dict[str, Array] = {}
    for joint in joints:
        at, goals = _sort(found.goals[joint])
        before = np.searchsorted(at, time, side="right") - 1
        channels[f"goal.{joint}"] = np.where(before >= 0, goals[np.maximum(before, 0)], np.nan)
        seen, positions = clocks[joint]
        channels[f"position.{joint}"] = positions if np.array_equal(seen, time) else np.interp(time, seen, positions)
    started = np.flatnonzero(np.isfinite([channels[f"goal.{j}"] for j in joints]).all(axis=0))
    if len(started) < 2:
        raise InputError(source, "a rosbag whose goals come after its positions: expected them at the same times")
    rows = slice(int(started[0]), None)
    channels = {name: values[rows] for name, values in channels.items()}
    time = time[rows] - time[rows][0]
    goals = np.column_stack([channels[f"goal.{j}"] for j in joints])
    return Recording(source=source, kind="rosbag", version="", time=time, frames=np.arange(len(time)), rate=rate_of(time),
                     units="radians", channels=channels, metadata={"topics": ", ".join(found.topics)},
                     commands=commands_of_rows(time, tuple(joints), goals, np.ones(goals.shape, dtype=bool)))


def _pose_recording(source: str, found: _Found) -> Recording:
    """Bodies on the clock of the one seen most often; frames in which another body was not seen are gaps."""
    stamps = {body: np.array([t for t, _, _ in poses]) for body, poses in found.poses.items()}
    time = np.unique(max(stamps.values(), key=len))
    near = 0.5 * float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    bodies = {}
    for body, poses in found.poses.items():
        p, q = np.full((len(time), 3), np.nan), np.full((len(time), 4), np.nan)
        at = np.clip(np.searchsorted(time, stamps[body] - near), 0, len(time) - 1)
        for k, (t, place, turn) in zip(at, poses):
            if abs(time[k] - t) <= near:
                p[k], q[k] = place, turn
        bodies[body] = p, q
    return recording_of(source, "rosbag", Capture(time, bodies, {}))


FORMAT = RecordingFormat("rosbag", "a bag of ROS (rosbag, SQLite, MCAP)", matches, read_rosbag, marks="metadata.yaml")
