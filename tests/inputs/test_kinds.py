"""Files of the trade that are not read are named by how they begin, with the way to what is; hints name joints that are there."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.inputs.corpus import ROBOT
from workbench.files import InputError
from workbench.files.kinds import kind_of_file
from workbench.inspect.recognise import inspect_file
from workbench.recording import read_recording

LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n"


@pytest.mark.parametrize(("beginning", "said"), [
    (b"\x89HDF\r\n\x1a\n", "HDF5"), (b"MATLAB 5.0 MAT-file, Platform", "MATLAB"), (b"\x1f\x8b\x08\0", "gzip"),
    (b"7z\xbc\xaf\x27\x1c\0", "7z"), (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "Excel"), (b"ULog\x01\x12\x35\x01", "PX4"),
    (b"\x80\x04\x95", "pickle"), (b"%PDF-1.7", "PDF"), (LFS, "git lfs pull"),
])
def test_a_file_of_another_kind_is_named(tmp_path: Path, beginning: bytes, said: str) -> None:
    path = tmp_path / "recording.dat"
    path.write_bytes(beginning + bytes(400 if beginning is not LFS else 0))
    with pytest.raises(InputError, match=said):
        read_recording(path)


def test_an_archive_with_a_table_in_it_is_to_be_unpacked(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "take.zip", "w") as packed:
        packed.writestr("take.csv", "time,goal.a,position.a\n0,0,0\n")
    with pytest.raises(InputError, match="zip archive; unpack it"):
        read_recording(tmp_path / "take.zip")


def test_a_take_of_motive_is_named_by_its_suffix() -> None:
    assert "Export Tracking Data" in str(kind_of_file(bytes(300), ".tak"))
    assert kind_of_file(bytes(300), ".xyz") is None


@pytest.mark.parametrize(("header", "said"), [
    ("time_s (s),command (rad),motor_position (rad),motor_velocity (rad/s)", r"command \(rad\) to goal\.J .*motor_position "
                                                                             r"\(rad\) to "
     r"position\.J, .*turn radians into degrees"),
    ("stamp,target_hip,actual_hip [deg]", r"stamp to time, target_hip to goal\.hip, actual_hip \[deg\] to position\.hip"),
    ("t,cmd.knee,knee.torque,state.knee.pos", r"cmd\.knee to goal\.knee, state\.knee\.pos to position\.knee"),
    ("time_s,hip_deg,knee_deg", "nearly a motion table.*time, hip, knee"),
])
def test_renames_lead_to_a_goal_and_a_position_of_one_joint(tmp_path: Path, header: str, said: str) -> None:
    path = tmp_path / "log.csv"
    path.write_text(header + "\n" + ",".join("0" * (header.count(",") + 1)) + "\n")
    with pytest.raises(InputError, match=said) as told:
        read_recording(path)
    assert "goal.(" not in str(told.value)


def test_columns_of_one_kind_alone_get_no_rename(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("time,hip.torque,hip.velocity\n0,0,0\n")
    with pytest.raises(InputError) as told:
        read_recording(path)
    assert "rename" not in str(told.value)


def _robot(folder: Path, extra: str, root: str = "trunk") -> Path:
    path = folder / "leg.urdf"
    path.write_text(ROBOT.replace("</robot>", extra + "</robot>"))
    return path


def test_a_robot_bolted_to_a_link_called_world_is_read(tmp_path: Path) -> None:
    path = _robot(tmp_path, '<link name="world"/><joint name="bolt" type="fixed"><parent link="world"/><child link="trunk"/>'
                            '<origin xyz="0 0 0.3"/></joint>')
    assert inspect_file(path).details["base"] == "fixed to the world"


@pytest.mark.parametrize("root", ["world", "odom"])
def test_a_floating_joint_from_the_world_is_a_free_base(tmp_path: Path, root: str) -> None:
    path = _robot(tmp_path, f'<link name="{root}"/><joint name="float" type="floating"><parent link="{root}"/>'
                            '<child link="trunk"/></joint>')
    found = inspect_file(path)
    assert found.details["base"] == "free"
    assert found.details["root"] == "trunk"
    assert found.joints == ("hip", "knee")
    assert found.problems == ()


def test_a_floating_joint_within_a_robot_is_refused_by_name(tmp_path: Path) -> None:
    path = _robot(tmp_path, '<link name="ball"/><joint name="loose" type="floating"><parent link="shank"/>'
                            '<child link="ball"/></joint>')
    with pytest.raises(InputError, match="joint 'loose' is floating"):
        inspect_file(path)


def test_an_axis_without_direction_is_told_with_its_joint(tmp_path: Path) -> None:
    path = tmp_path / "leg.urdf"
    path.write_text(ROBOT.replace('<axis xyz="0 1 0"/><limit lower="-2"', '<axis xyz="0 0 0"/><limit lower="-2"'))
    with pytest.raises(InputError, match="joint 'knee': axis 0 0 0"):
        inspect_file(path)


def test_a_frame_of_a_billionth_kilogram_is_no_problem(tmp_path: Path) -> None:
    path = _robot(tmp_path, '<link name="imu"><inertial><mass value="1e-9"/><inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" '
                            'ixz="0" iyz="0"/></inertial></link><joint name="imu_joint" type="fixed"><parent link="trunk"/>'
                            '<child link="imu"/></joint>')
    assert inspect_file(path).problems == ()


def test_a_centre_of_mass_far_outside_its_link_is_told(tmp_path: Path) -> None:
    path = tmp_path / "leg.urdf"
    path.write_text(ROBOT.replace('<origin xyz="0 0 -0.04"/><mass value="0.03"/>', '<origin xyz="0 0 -40"/><mass value="0.03"/>'))
    assert any("link 'shank': its centre of mass" in p and "millimetres" in p for p in inspect_file(path).problems)


def test_a_pointer_in_place_of_a_mesh_is_told(tmp_path: Path) -> None:
    (tmp_path / "leg.stl").write_bytes(LFS)
    path = tmp_path / "leg.urdf"
    path.write_text(ROBOT.replace('<box size="0.12 0.08 0.04"/>', '<mesh filename="leg.stl"/>'))
    with pytest.raises(InputError, match="git lfs pull"):
        inspect_file(path)


def test_two_rigid_bodies_of_one_name_are_told(tmp_path: Path) -> None:
    kinds = ["Rotation"] * 4 + ["Position"] * 3
    rows = [["Format Version", "1.23", "Export Frame Rate", "100", "Length Units", "Meters", "Rotation Type", "Quaternion"], [],
            ["", "", *["Rigid Body"] * 14], ["", "", *["leg"] * 14], ["", "", *["1"] * 7, *["2"] * 7], ["", "", *kinds, *kinds],
            ["Frame", "Time", *"XYZWXYZ" * 2]]
    rng = np.random.default_rng(0)
    for i in range(40):
        values = [v for _ in "ab" for v in (0, 0, 0, 1, *rng.normal(0, 1e-4, 3))]
        rows.append([str(i), f"{i / 100:.2f}", *(f"{v:.6f}" for v in values)])
    path = tmp_path / "take.csv"
    path.write_text("\n".join(",".join(row) for row in rows) + "\n")
    assert any("2 rigid bodies are called 'leg'" in p for p in inspect_file(path).problems)
