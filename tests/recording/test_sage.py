"""SAGE programmes as takes of a session: which programme a take means, and under which names its joints go."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.gap_sessions import session_content, write_session
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes
from workbench.files import InputError
from workbench.recording.formats.read import read_recording, recording_of_take
from workbench.recording.formats.sage import sage_programmes
from workbench.recording.joint_names import SO101_JOINTS as JOINTS
from workbench.recording.joint_names import URDF_JOINTS, named_by_model
from workbench.robot import RobotModel


def write_npz(path: Path, *names: str, n: int = 30) -> Path:
    t = 0.02 * np.arange(n)
    q = np.sin(t)[:, None] + np.arange(6)
    fields = {"t_cmd": t, "t_meas": t, "q_cmd": q, "q_meas": 0.9 * q, "v_meas": q, "tau_abs": np.abs(q)}
    np.savez(path, **{f"{name}/{k}": v for name in names for k, v in fields.items()})
    return path


def write_arm(folder: Path, names: tuple[str, ...]) -> RobotModel:
    links = "".join(f'<link name="l{i}"><inertial><mass>0.1</mass></inertial></link>' for i in range(len(names) + 1))
    joints = "".join(f'<joint name="{n}" type="revolute"><parent>l{i}</parent><child>l{i + 1}</child>'
                     "<axis><xyz>0 1 0</xyz></axis></joint>" for i, n in enumerate(names))
    path = folder / "six.sdf"
    path.write_text(f'<sdf version="1.9"><model name="six">{links}{joints}</model></sdf>')
    return RobotModel(description=str(path), base="l0")


def test_a_take_names_its_programme_by_hash_or_by_its_own_name(tmp_path: Path) -> None:
    many, one = write_npz(tmp_path / "many.npz", "step", "slow"), write_npz(tmp_path / "one.npz", "slow")
    assert sage_programmes(many) == ("step", "slow")
    assert recording_of_take(tmp_path / "many.npz#slow", "any") == tmp_path / "many.npz#slow"
    assert recording_of_take(many, "step") == tmp_path / "many.npz#step"
    assert recording_of_take(one, "any") == one
    assert read_recording(recording_of_take(many, "slow")).metadata["programme"] == "slow"
    for path, words in ((many, "holds 2 programmes"), (tmp_path / "many.npz#no", "no programme 'no'.*step, slow"),
                        (tmp_path / "none.npz#step", "file not found"), (tmp_path, "or state_motor.csv")):
        with pytest.raises(InputError, match=words):
            recording_of_take(path, "any")


def test_programmes_of_one_npz_are_takes_of_a_session(tmp_path: Path) -> None:
    write_npz(tmp_path / "many.npz", "step", "slow")
    write_arm(tmp_path, JOINTS)
    content = session_content() | {
        "robot": {"model": "six.sdf", "base": "l0"},
        "takes": [{"name": "slow", "recording": "many.npz", "base": "fixed"},
                  {"name": "other", "recording": "many.npz#step", "base": "fixed", "use": "validate"}]}
    takes, left_out = read_takes(load_session(write_session(tmp_path, content)))
    assert [t.recording.metadata["programme"] for t in takes] == ["slow", "step"]
    assert left_out == ()
    content["takes"][0]["recording"] = "many.npz#fast"
    with pytest.raises(InputError, match=r"takes\[0\].recording: no programme 'fast'"):
        load_session(write_session(tmp_path, content))


def test_joints_go_by_the_urdfs_names_where_the_model_has_these(tmp_path: Path) -> None:
    recording = read_recording(write_npz(tmp_path / "one.npz", "step"))
    renamed = named_by_model(recording, write_arm(tmp_path, tuple(URDF_JOINTS.values())))
    for ours, urdf in URDF_JOINTS.items():
        np.testing.assert_array_equal(renamed.channels[f"position.{urdf}"], recording.channels[f"position.{ours}"])
    assert renamed.commands is not None
    assert renamed.commands.joints == tuple(URDF_JOINTS.values())
    (tmp_path / "kept").mkdir()
    assert named_by_model(recording, write_arm(tmp_path / "kept", JOINTS)) is recording
    (tmp_path / "other").mkdir()
    with pytest.raises(InputError, match="unknown joint 'Rotation'"):
        named_by_model(recording, write_arm(tmp_path / "other", ("a", "b", "c", "d", "e", "f")))
