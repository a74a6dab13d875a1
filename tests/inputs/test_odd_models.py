"""Descriptions with what a robot here does not have: joints on the world, couplings, angles in degrees, other names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.inputs.corpus import ROBOT, SDF
from workbench.files import InputError
from workbench.inspect.recognise import inspect_file
from workbench.robot import RobotModel

PENDULUM = """<robot name="rig"><link name="world"/>
<link name="arm"><inertial><origin xyz="0 0 -0.1"/><mass value="0.3"/>
<inertia ixx="1e-4" iyy="1e-4" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="swing" type="revolute"><parent link="world"/><child link="arm"/><origin xyz="0 0 0.4" rpy="0.3 0 0"/>
<axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5" effort="2" velocity="6"/></joint></robot>
"""


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def _write(folder: Path, text: str, name: str) -> Path:
    (folder / name).write_text(text)
    return folder / name


@pytest.mark.parametrize(("text", "name", "joint"), [
    (PENDULUM, "rig.urdf", "swing"), (SDF.replace("<parent>r</parent>", "<parent>world</parent>"), "rig.sdf", "j")])
def test_a_joint_on_the_world_is_a_joint(tmp_path: Path, text: str, name: str, joint: str) -> None:
    if name == "rig.sdf":  # the link that it hung on is no part of the rig then
        text = text[:text.index('<link name="r">')] + text[text.index('<link name="a">'):]
    found = inspect_file(_write(tmp_path, text, name))
    assert found.joints == (joint,)
    assert found.problems == ()
    assert found.details["base"] == "fixed to the world"
    assert "moves against the world" in str(found.details["for Drake"])


def test_a_joint_on_the_world_turns_where_its_file_has_it(tmp_path: Path) -> None:
    on_world = RobotModel(str(_write(tmp_path, PENDULUM, "rig.urdf")))
    bolt = '<link name="world"/><joint name="bolt" type="fixed"><parent link="world"/><child link="plate"/></joint></robot>'
    named = PENDULUM.replace("world", "plate").replace("</robot>", bolt)
    bolted = RobotModel(str(_write(tmp_path, named, "bolted.urdf")))
    q = np.array([[0.7]])
    for a, b in zip(on_world.kinematics.forward(q)["arm"], bolted.kinematics.forward(q)["arm"]):
        np.testing.assert_allclose(a, b, atol=1e-12)


def test_a_slide_on_the_world_is_refused(tmp_path: Path) -> None:
    path = _write(tmp_path, PENDULUM.replace("revolute", "prismatic"), "rig.urdf")
    with pytest.raises(InputError, match="joint 'swing' is prismatic"):
        inspect_file(path)


def test_the_mimic_of_an_sdf_is_reported(tmp_path: Path) -> None:
    coupled = SDF.replace("</limit></axis>", '</limit><mimic joint="k"><multiplier>1</multiplier></mimic></axis>')
    model = RobotModel(str(_write(tmp_path, coupled, "m.sdf")))
    assert model.problems == ("joint 'j' mimics 'k'; here it is a joint of its own, with a servo",)
    assert "mimic" not in model.path.read_text()


@pytest.mark.parametrize(("text", "name", "part"), [
    (ROBOT.replace('rpy="0.1 0 0"', 'rpy="90 0 0"'), "r.urdf", "joint 'hip'"),
    (SDF.replace("<pose>0 0 -0.1 0 0 0</pose>", "<pose>0 0 -0.1 0 0 -180</pose>"), "r.sdf", "link 'a'")])
def test_poses_in_degrees_are_reported(tmp_path: Path, text: str, name: str, part: str) -> None:
    (told,) = RobotModel(str(_write(tmp_path, text, name))).problems
    assert told.startswith(f"{part}: a pose of ")
    assert told.endswith("are the angles in degrees?")


def test_poses_that_say_degrees_are_sound(tmp_path: Path) -> None:
    text = SDF.replace("<pose>0 0 -0.1 0 0 0</pose>", '<pose degrees="true">0 0 -0.1 0 0 -180</pose>')
    assert RobotModel(str(_write(tmp_path, text, "r.sdf"))).problems == ()


@pytest.mark.parametrize("name", ["m.urdf", "m.xml", "M.SDF"])
def test_an_sdf_is_known_by_its_content(tmp_path: Path, name: str) -> None:
    found = inspect_file(_write(tmp_path, SDF, name))
    assert (found.joints, found.problems) == (("j",), ())


def test_computed_inertias_are_refused(tmp_path: Path) -> None:
    path = _write(tmp_path, SDF.replace("<inertial>", '<inertial auto="true">'), "m.sdf")
    with pytest.raises(InputError, match="link 'r': <inertial auto>: expected <mass> and <inertia> in numbers"):
        RobotModel(str(path))
