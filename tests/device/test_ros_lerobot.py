"""Bags of ROS 2 are written and read, and every command of docs/ros2.md and docs/lerobot.md runs as it is printed."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from tests.command import succeeds
from tests.device.motive import NAMES, scene
from tests.device.servos import arm, robot
from workbench.device.bus.survey import survey
from workbench.device.capture import Recorder, record_take
from workbench.device.play import PlayOptions, perform
from workbench.device.virtual.motive import VirtualLink, VirtualMotive
from workbench.files import InputError
from workbench.motion import Motion, load_motion
from workbench.recording.formats.read import read_recording
from workbench.recording.formats.rosbag_write import write_rosbag

DOCS = Path(__file__).parents[2] / "docs"
ANGLES = np.radians([[0.0, 0, 0], [12, -10, 8], [-6, 9, -12], [0, 0, 0]])
MOTION = Motion("wave", 0.2 * np.arange(4), ("one", "three", "two"), ANGLES)
BEGAN = 1_800_000_000.25


def trajectories(folder, *tables, first=0.0):
    """A bag of joint trajectories: of each table, names and rows of degrees 0.2 s apart, the first at `first` [s]."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types, kind, none = store.types, "trajectory_msgs/msg/JointTrajectory", np.zeros(0)
    stamp = types["builtin_interfaces/msg/Time"](sec=5, nanosec=0)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection("/arm_controller/joint_trajectory", kind, typestore=store)
        for n, (names, rows) in enumerate(tables):
            points = []
            for k, row in enumerate(rows):
                after = round(1e9 * (first + 0.2 * k))
                points.append(types["trajectory_msgs/msg/JointTrajectoryPoint"](
                    positions=np.radians(row), velocities=none, accelerations=none, effort=none,
                    time_from_start=types["builtin_interfaces/msg/Duration"](sec=after // 10**9, nanosec=after % 10**9)))
            message = types[kind](header=types["std_msgs/msg/Header"](stamp=stamp, frame_id=""), joint_names=list(names),
                                  points=points)
            bag.write(connection, 5_000_000_000 + n, store.serialize_cdr(message, kind))
    return folder


ROWS = np.array([[0.0, 0], [10, -5], [-10, 5]])


def test_a_trajectory_is_a_motion(tmp_path):
    motion = load_motion(trajectories(tmp_path / "a", (("one", "two"), ROWS)))
    assert (motion.joints, motion.cycles) == (("one", "two"), 1)
    np.testing.assert_allclose(motion.times, [0, 0.2, 0.4])
    np.testing.assert_allclose(np.degrees(motion.angles), ROWS)
    later = load_motion(next(trajectories(tmp_path / "b", (("one", "two"), ROWS + 3), first=0.5).glob("*.mcap")))
    np.testing.assert_allclose(later.times, [0, 0.5, 0.7, 0.9])
    np.testing.assert_allclose(later.angles[0], 0)


def test_a_bag_without_one_trajectory_is_refused(tmp_path):
    two = trajectories(tmp_path / "two", (("one", "two"), ROWS), (("one", "two"), 2 * ROWS))
    with pytest.raises(InputError, match=r"2 trajectories; name one of them, .*two#1 to"):
        load_motion(two)
    np.testing.assert_allclose(np.degrees(load_motion(f"{two}#2").angles), 2 * ROWS)
    with pytest.raises(InputError, match="'#3': expected the number of a trajectory, 1 to 2"):
        load_motion(f"{two}#3")
    with pytest.raises(InputError, match="the robot has no joint 'elbow'; its joints: one"):
        load_motion(trajectories(tmp_path / "other", (("one", "elbow"), ROWS)), arm(tmp_path))
    with pytest.raises(InputError, match="no topic of the type trajectory_msgs/JointTrajectory"):
        load_motion(trajectories(tmp_path / "none"))
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(b"\x89MCAP0\r\n" + bytes(60))
    with pytest.raises(InputError, match="a bag that cannot be read"):
        load_motion(broken)


def test_a_played_motion_becomes_joint_states_and_a_trajectory(tmp_path):
    r = robot(model=arm(tmp_path))
    bus = r.bus()
    log = tmp_path / "w.csv"
    played = perform(bus, survey(bus, r.model, ids=()), MOTION.commands(1), log, lambda: "", PlayOptions(rest=0.3))
    assert 0.3 < played.started - played.log_start < 0.6
    written = read_recording(log)
    folder = write_rosbag(written, tmp_path / "bag", BEGAN)
    assert {p.name for p in folder.iterdir()} == {"bag.mcap", "metadata.yaml"}
    for place in (folder, folder / "bag.mcap"):
        again = read_recording(place)
        assert set(again.joints) == set(MOTION.joints)
        for joint in MOTION.joints:
            told = written.channels[f"position.{joint}"]
            there = np.isfinite(told)
            np.testing.assert_allclose(np.interp(written.time[there] - written.time[there][0], again.time,
                                                 again.channels[f"position.{joint}"])[2:-2], told[there][2:-2], atol=2e-3)
    sent = load_motion(folder)
    for joint in MOTION.joints:
        goals = written.channels[f"goal.{joint}"]
        assert sent.angles[:, sent.joints.index(joint)].max() == pytest.approx(np.nanmax(goals))
    write_rosbag(written, folder, BEGAN)
    (tmp_path / "other").mkdir()
    with pytest.raises(InputError, match="already exists and is not a bag"):
        write_rosbag(written, tmp_path / "other", BEGAN)
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="holds more than one"):
        write_rosbag(written, folder, BEGAN)
    assert (folder / "notes.txt").read_text() == "mine"
    (tmp_path / "other" / "metadata.yaml").write_text("title: photographs\n")
    with pytest.raises(InputError, match="is not a bag"):
        write_rosbag(written, tmp_path / "other", BEGAN)


def test_a_take_becomes_transforms(tmp_path):
    capture = record_take(Recorder(VirtualLink(VirtualMotive(NAMES, scene, rate=100.0))), tmp_path / "t.csv", lambda: False, 0.5)
    take = read_recording(capture.take)
    again = read_recording(write_rosbag(take, tmp_path / "bag", BEGAN))
    assert set(again.rigid_bodies) == set(NAMES)
    for name, track in take.rigid_bodies.items():
        np.testing.assert_allclose(again.rigid_bodies[name].p, track.p, atol=1e-9)
        np.testing.assert_allclose(again.rigid_bodies[name].quat, track.quat, atol=1e-9)


def blocks(page, kind):
    """Fenced blocks of a page, of one kind."""
    return re.findall(rf"```{kind}\n(.*?)```", (DOCS / page).read_text(), re.S)


CALIBRATION = {joint: {"id": n, "drive_mode": int(joint == "two"), "homing_offset": 0, "range_min": 1000, "range_max": 3096}
               for n, joint in enumerate(("one", "two", "three"), 1)}


def urdf():
    """An arm of three joints on a fixed trunk."""
    inertial = ("<inertial><origin xyz='0 0 0.04'/><mass value='0.1'/>"
                "<inertia ixx='1e-4' iyy='1e-4' izz='2e-5' ixy='0' ixz='0' iyz='0'/></inertial>")
    links = "".join(f"<link name='{name}'>{inertial}</link>" for name in ("trunk", "upper", "middle", "lower"))
    joints = "".join(
        f"<joint name='{name}' type='revolute'><parent link='{parent}'/><child link='{child}'/><origin xyz='0 0 0.08'/>"
        f"<axis xyz='{axis}'/><limit lower='-2.6' upper='2.6' effort='1.5' velocity='6'/></joint>"
        for name, parent, child, axis in (("one", "trunk", "upper", "0 1 0"), ("two", "upper", "middle", "0 1 0"),
                                          ("three", "middle", "lower", "1 0 0")))
    return f"<robot name='arm'>{links}{joints}</robot>"


def robot_folder(folder):
    """A robot such as the pages speak of."""
    (folder / "arm.urdf").write_text(urdf())
    (folder / "so101.json").write_text(json.dumps(CALIBRATION))
    bag = trajectories(folder / "bag", (("one", "two", "three"), np.array([[0.0, 0, 0], [8, -5, 4], [-8, 5, -4], [0, 0, 0]])))
    next(bag.glob("*.mcap")).rename(folder / "trajectory.mcap")
    shutil.rmtree(bag)
    rows = "\n".join(f"{0.2 * k:.1f},{a},{-a},{a}" for k, a in enumerate((0, 8, -8, 0)))
    (folder / "wave.csv").write_text(f"time,one,two,three\n{rows}\n")


@pytest.mark.slow
@pytest.mark.parametrize("page", ["ros2.md", "lerobot.md"])
def test_the_commands_of_the_page_run(page, tmp_path, monkeypatch, capsys):
    """In the order in which they are printed, with the files that the page prints."""
    robot_folder(tmp_path)
    robot_yaml, session = blocks(page, "yaml")
    (tmp_path / "robot.yaml").write_text(robot_yaml)
    (tmp_path / "session.yaml").write_text(session)
    monkeypatch.chdir(tmp_path)
    commands = [line.split()[1:] for block in blocks(page, "console") for line in block.splitlines()]
    assert len(commands) >= 4
    for command in commands:
        assert succeeds(capsys, *command)
    assert (tmp_path / "runs" / "compare").is_dir()
