"""Joint trajectories in bags of ROS 1 and ROS 2 (trajectory_msgs/JointTrajectory) as motions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from workbench.files import InputError
from workbench.motion.motion import Motion

BAGS = (".mcap", ".db3", ".bag")
TYPE = "JointTrajectory"
_DAMAGED = (OSError, ValueError, KeyError, RuntimeError, IndexError, AssertionError, AttributeError, TypeError, EOFError)


def is_bag(path: str | Path) -> bool:
    """Whether a name is that of a bag: a file by its ending, or a folder with the metadata of ROS 2."""
    return Path(path).suffix.lower() in BAGS or (Path(path) / "metadata.yaml").is_file()


def load_trajectory(path: str | Path, which: str = "") -> Motion:
    """The joint trajectory in a bag, played once. which: its number, from 1, where the bag holds several.

    Each point is a pose; its velocities are not used, as the servos' moving speeds follow from the times. A first point later
    than 0 s is reached from neutral. InputError where the bag is damaged, or holds none or several.
    """
    messages = trajectories(path)
    count = len(messages)
    if not count:
        raise InputError(path, f"no topic of the type trajectory_msgs/{TYPE}")
    if which and not (which.isdecimal() and 1 <= int(which) <= count):
        raise InputError(path, f"'#{which}': expected the number of a trajectory, 1 to {count}")
    if not which and count > 1:
        raise InputError(path, f"{count} trajectories; name one of them, {path}#1 to {path}#{count}")
    return _motion(str(path), messages[int(which or 1) - 1])


def trajectories(path: str | Path) -> list[Any]:
    """The joint-trajectory messages of a bag, in the order of their times; InputError where it cannot be read."""
    try:
        return _messages(Path(path))
    except Exception as e:
        if not isinstance(e, _DAMAGED) and not type(e).__module__.startswith("rosbags"):
            raise
        raise InputError(path, f"a bag that cannot be read: {' '.join(str(e).split())[:200]}") from None


def _messages(path: Path) -> list[Any]:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        wanted = [c for c in reader.connections if c.msgtype.rpartition("/")[2] == TYPE]
        return [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(connections=wanted)] if wanted else []


def _motion(source: str, message: Any) -> Motion:
    joints = tuple(map(str, message.joint_names))
    times, rows = [], []
    for k, point in enumerate(message.points):
        if len(point.positions) != len(joints):
            raise InputError(source, f"point {k + 1}: {len(point.positions)} positions for {len(joints)} joints")
        times.append(point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec)
        rows.append([float(x) for x in point.positions])
    if times and times[0] > 0:
        times.insert(0, 0.0)
        rows.insert(0, [0.0] * len(joints))
    if len(times) < 2:
        raise InputError(source, f"a trajectory of {len(times)} points; expected two, or one later than 0 s")
    return Motion(Path(source).stem, np.array(times), joints, np.array(rows), source, cycles=1)
