"""One body's path, or one joint's log, written as each tool of the trade writes it, is the same recording when it is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.inputs.corpus import joint_log, swing
from workbench.files import InputError
from workbench.inspect.recognise import inspect_file
from workbench.recording import Recording, read_recording
from workbench.recording import quaternions as quat

RATE = 100.0
ROWS = 80
MARKS = np.array([[0.05, 0, 0], [-0.04, 0.03, 0], [-0.01, -0.03, 0.02], [0, 0, 0.04]])


def _path() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], places [m] and quaternions wxyz of a body, z up; it begins without a rotation."""
    time = np.arange(ROWS) / RATE
    p = np.column_stack([0.3 * time, 0.05 * np.sin(5 * time), 0.2 + 0.01 * np.cos(9 * time)])
    return time, p, np.column_stack([np.cos(0.3 * time), *(np.sin(0.3 * time) * a for a in (0.6, 0.0, 0.8))])


def _matrices(q: np.ndarray) -> np.ndarray:
    return np.array([quat.matrix(x) for x in q])


def _body_poses(path: Path) -> None:
    time, p, q = _path()
    names = ["time", *(f"leg.{a}" for a in ("x", "y", "z", "qw", "qx", "qy", "qz"))]
    pd.DataFrame(np.column_stack([time, p, q]), columns=names).to_csv(path, index=False)


def _in_millimetres(path: Path) -> None:
    _body_poses(path)
    table = pd.read_csv(path)
    for axis in "xyz":
        table[f"leg.{axis}_mm"] = 1e3 * table.pop(f"leg.{axis}")
    table.to_csv(path, index=False)


def _qualisys(path: Path) -> None:
    _, p, q = _path()
    rows = [["NO_OF_FRAMES", str(ROWS)], ["FREQUENCY", f"{RATE:g}"], ["DATA_INCLUDED", "6D"], ["BODY_NAMES", "leg"],
            ["leg X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{i}]" for i in range(9))]]
    rows += [[f"{v:.6f}" for v in (*1e3 * place, 0, 0, 0, 0.3, *R.T.ravel())] for place, R in zip(p, _matrices(q))]
    path.write_text("\n".join("\t".join(row) for row in rows) + "\n")


def _vicon(path: Path) -> None:
    _, p, q = _path()
    turn = np.array([quat.rotation_vector(x[None])[0] for x in q])
    rows = ["Segments", f"{RATE:g}", ",,robot:leg,,,,,", "Frame,Sub Frame,RX,RY,RZ,TX,TY,TZ", ",,rad,rad,rad,mm,mm,mm"]
    rows += [f"{i + 1},0," + ",".join(f"{v:.7f}" for v in (*a, *1e3 * b)) for i, (a, b) in enumerate(zip(turn, p))]
    path.write_text("\n".join(rows) + "\n")


def _optitrack_rows(path: Path) -> None:
    time, p, q = _path()
    rows = ['comment,"OptiTrack Export Data"', "righthanded", "info,version,1.1", 'rigidbody,"leg",7,3']
    rows += [f"frame,{i},{t:.6f},1,7," + ",".join(f"{v:.8f}" for v in (a, c, -b, x, z, -y, w, 0, 0, 0)) + ",0"
             for i, (t, (a, b, c), (w, x, y, z)) in enumerate(zip(time, p, q))]
    path.write_text("\n".join(rows) + "\n")


def _markers() -> np.ndarray:
    """(N, 4, 3) [m] of the body's marks, z up; their middle is its place."""
    _, p, q = _path()
    return p[:, None] + np.einsum("nij,kj->nki", _matrices(q), MARKS - MARKS.mean(axis=0))


def _trc(path: Path) -> None:
    at = _markers()[..., [0, 2, 1]] * [1, 1, -1]
    rows = ["PathFileType\t4\t(X/Y/Z)\ta.trc", "DataRate\tNumFrames\tUnits", f"{RATE:g}\t{ROWS}\tmm",
            "Frame#\tTime\t" + "\t\t\t".join(f"leg_{k}" for k in range(4)), "\t\tX1\tY1\tZ1"]
    rows += [f"{i + 1}\t{i / RATE:.4f}\t" + "\t".join(f"{1e3 * v:.5f}" for v in row.ravel()) for i, row in enumerate(at)]
    path.write_text("\n".join(rows) + "\n")


def _c3d(path: Path) -> None:
    import ezc3d

    out = ezc3d.c3d()
    out["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    out["parameters"]["POINT"]["LABELS"]["value"] = [f"leg_{k}" for k in range(4)]
    out["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = np.ones((4, 4, ROWS))
    points[:3] = 1e3 * _markers().transpose(2, 1, 0)
    out["data"]["points"] = points
    out.write(str(path))


def _bag(path: Path, messages: list[tuple[str, float, object]]) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    folder = path.with_suffix(".bag2")
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics: dict[str, object] = {}
        for topic, time, message in messages:
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=types)
            bag.write(topics[topic], round(1e9 * (1000 + time)), types.serialize_cdr(message, kind))
    next(folder.glob("*.mcap")).rename(path)


def _pose_bag(path: Path) -> None:
    from rosbags.typesys import Stores, get_typestore

    t = get_typestore(Stores.ROS2_HUMBLE).types
    messages = []
    for time, p, (w, *v) in zip(*_path()):
        header = t["std_msgs/msg/Header"](stamp=t["builtin_interfaces/msg/Time"](sec=0, nanosec=0), frame_id="world")
        place, turn = t["geometry_msgs/msg/Point"](*p), t["geometry_msgs/msg/Quaternion"](*v, w)
        pose = t["geometry_msgs/msg/Pose"](position=place, orientation=turn)
        messages.append(("/mocap/leg/pose", time, t["geometry_msgs/msg/PoseStamped"](header=header, pose=pose)))
    _bag(path, messages)


@pytest.mark.parametrize(("write", "name", "kind"), [
    (_body_poses, "poses.csv", "body_poses"), (_in_millimetres, "poses.csv", "body_poses"), (_qualisys, "6d.tsv", "qualisys"),
    (_vicon, "vicon.csv", "vicon"), (_optitrack_rows, "old.csv", "optitrack_rows"), (_trc, "markers.trc", "trc"),
    (_c3d, "take.c3d", "c3d"), (_pose_bag, "take.mcap", "rosbag"),
])
def test_a_body_is_read_where_it_was(tmp_path: Path, write, name: str, kind: str) -> None:
    write(tmp_path / name)
    found = read_recording(tmp_path / name)
    time, p, q = _path()
    assert (found.kind, found.sensing, list(found.rigid_bodies)) == (kind, "mocap", ["leg"])
    np.testing.assert_allclose(found.time, time, atol=1e-6)
    body = found.rigid_bodies["leg"]
    np.testing.assert_allclose(body.p, p[:, [0, 2, 1]] * [1, 1, -1], atol=2e-6)
    w, x, y, z = q.T
    same = np.abs(np.einsum("ni,ni->n", body.quat, np.column_stack([w, x, z, -y])))
    np.testing.assert_allclose(same, 1.0, atol=1e-6)
    assert inspect_file(tmp_path / name).assets == ("leg",)


def test_a_bag_of_goals_and_joint_states_is_a_servo_log(tmp_path: Path) -> None:
    from rosbags.typesys import Stores, get_typestore

    t = get_typestore(Stores.ROS2_HUMBLE).types
    time, goal, position = swing()
    messages, none = [], np.zeros(0)
    for at, g, p in zip(time, np.deg2rad(goal), np.deg2rad(position)):
        stamp = t["builtin_interfaces/msg/Time"](sec=1000 + int(at), nanosec=round(1e9 * (at % 1)))
        header = t["std_msgs/msg/Header"](stamp=stamp, frame_id="")
        for topic, value in (("/joint_command", g), ("/joint_states", p)):
            messages.append((topic, at, t["sensor_msgs/msg/JointState"](header=header, name=["arm"], position=np.array([value]),
                                                                        velocity=none, effort=none)))
    _bag(tmp_path / "log.mcap", messages)
    log = read_recording(tmp_path / "log.mcap")
    assert (log.kind, log.joints, log.problems) == ("rosbag", ("arm",), ())
    np.testing.assert_allclose(log.channels["position.arm"], np.deg2rad(position), atol=1e-9)
    np.testing.assert_allclose(log.channels["goal.arm"], np.deg2rad(goal), atol=1e-9)
    _bag(tmp_path / "states.mcap", [m for m in messages if m[0] == "/joint_states"])
    with pytest.raises(InputError, match=r"positions of joints but no goals .*/joint_states"):
        read_recording(tmp_path / "states.mcap")


def test_a_sheet_of_excel_is_read_as_its_table(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(joint_log(*swing()))
    pd.read_csv(tmp_path / "log.csv").to_excel(tmp_path / "log.xlsx", index=False)
    sheet, table = (read_recording(tmp_path / f"log.{x}") for x in ("xlsx", "csv"))
    assert isinstance(sheet, Recording)
    assert sheet.kind == "joint_log"
    np.testing.assert_allclose(sheet.channels["position.arm"], table.channels["position.arm"], atol=1e-12)


@pytest.mark.parametrize(("write", "name"), [(_c3d, "take.c3d"), (_pose_bag, "take.mcap"), (_qualisys, "6d.tsv"),
                                             (_vicon, "vicon.csv"), (_optitrack_rows, "old.csv"), (_trc, "markers.trc")])
def test_a_file_that_is_cut_is_refused_in_one_line_or_read_up_to_there(tmp_path: Path, write, name: str) -> None:
    write(tmp_path / name)
    whole = (tmp_path / name).read_bytes()
    said = []
    for share in (0.3, 0.71, 0.97):
        (tmp_path / name).write_bytes(whole[:int(share * len(whole))])
        try:
            read_recording(tmp_path / name)
        except InputError as e:
            said.append(str(e))
    assert not any("\n" in text for text in said)


def test_a_capture_that_is_no_small_robot_in_a_room_is_doubted(tmp_path: Path) -> None:
    from workbench.recording import read_recording

    time = np.arange(40) / 50
    place, still = np.column_stack([0.2 * time, 0 * time, 0.1 + 0 * time]), np.tile([1.0, 0, 0, 0], (40, 1))

    def read(time: np.ndarray, place: np.ndarray, turn: np.ndarray) -> tuple[str, ...]:
        path = tmp_path / "poses.csv"
        names = ["time", *(f"leg.{n}" for n in ("x", "y", "z", "qw", "qx", "qy", "qz"))]
        path.write_text("\n".join([",".join(names), *(",".join(map(str, row)) for row in np.column_stack([time, place, turn]))]))
        return read_recording(path).problems

    assert read(time, place, still) == ()
    assert "quaternions written x, y, z, w" in read(time, place, np.roll(still, -1, axis=1))[0]
    assert "millimetres" in read(time, 1000 * place * 10, still)[0]
    assert "frame numbers" in read(50 * time, place, still)[0]


@pytest.mark.parametrize(("name", "content", "said"), [
    ("arm.xml", "<mujoco/>", "MuJoCo model"), ("arm.usd", "PXR-USDC\0\0", "OpenUSD"), ("leg.stl", "solid leg\n", "mesh"),
    ("arm.json", '{"pan": {"id": 1, "homing_offset": 3, "range_min": 0, "range_max": 9}}', "calibration file of LeRobot"),
    ("log.csv", "time,goal.a,position.a\n2025-03-04T12:00:00.02,1,1\n", "seconds since the first row"),
    ("log.csv", "time,input_pos,pos_estimate\n0,1,1\n0.1,1,1\n", "rename input_pos to goal"),
    ("log.csv", "time,target_joint_pos_hip,joint_pos_hip\n0,1,1\n0.1,1,1\n", "rename target_joint_pos_hip to goal.hip"),
])
def test_what_a_file_is_and_what_to_do_with_it(tmp_path: Path, name: str, content: str, said: str) -> None:
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(ValueError, match=said):
        inspect_file(path)
