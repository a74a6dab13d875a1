"""Robots as people have them: URDF with STL meshes and ROS packages, and impossible robots."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from tests.inputs.corpus import ROBOT, SDF
from workbench.effects.apply import physics_of
from workbench.files import InputError
from workbench.inspect.recognise import inspect_file
from workbench.robot import EffectSpec, Kinematics, RobotModel
from workbench.robot.model_source import model_problems, prepare
from workbench.simulation import MakeStation
from workbench.simulation.compiled import kernel


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def _robot(folder: Path, text: str = ROBOT, name: str = "robot.urdf") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def _meshed(uri: str) -> str:
    """The robot with a mesh as the trunk's look and as what touches."""
    mesh = f'<geometry><mesh filename="{uri}" scale="0.001 0.001 0.001"/></geometry>'
    return ROBOT.replace('<collision><geometry><box size="0.12 0.08 0.04"/></geometry></collision>',
                         f"<visual>{mesh}</visual><collision>{mesh}</collision>")


def _box_mesh(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box((120, 80, 40)).export(path)
    return path


def test_a_urdf_has_the_kinematics_that_drake_reads_of_it(tmp_path: Path) -> None:
    path = _robot(tmp_path)
    model = RobotModel(str(path))
    plant = MultibodyPlant(0.0)
    (instance,) = Parser(plant).AddModels(str(path))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    q = np.array([0.3, -0.7])
    for joint, angle in zip(model.joints, q):
        plant.GetJointByName(joint).set_angle(context, angle)
    poses = model.kinematics.forward(q)
    trunk = plant.GetFrameByName("trunk")
    for link in model.kinematics.links:
        X = plant.GetFrameByName(link, instance).CalcPose(context, trunk)
        np.testing.assert_allclose(poses[link][0][0], X.translation(), atol=1e-12)
        np.testing.assert_allclose(poses[link][1][0], X.rotation().matrix(), atol=1e-12)
        assert model.kinematics.masses[link] == pytest.approx(plant.GetBodyByName(link).default_mass())
        np.testing.assert_allclose(model.kinematics.centers[link], plant.GetBodyByName(link).default_com(), atol=1e-12)
    assert model.kinematics.frames["knee"].lower == -2
    assert model.problems == ()
    assert model.description == str(path)


@pytest.mark.parametrize(("effect", "where", "parameters"), [
    ("payload", ("shank",), {"mass": 0.05, "position": (0.0, 0.0, -0.05)}), ("backlash", ("knee",), {"gap": 3.0}),
    ("joint_compliance", ("hip",), {"stiffness": 5.0}), ("link_length", ("shank",), {"change": 0.01}),
    ("com_shift", ("trunk",), {"offset": (0.01, 0.0, 0.0)}), ("joint_stop", ("knee",), {"lower": -10.0, "upper": 20.0}),
])
def test_effects_that_change_the_build_act_on_a_urdf(tmp_path: Path, effect: str, where: tuple[str, ...],
                                                            parameters: dict) -> None:
    model = RobotModel(str(_robot(tmp_path))).with_effect(EffectSpec(effect, where, parameters))
    description = physics_of(model).description
    assert description is not None
    changed = Kinematics.from_text(description, model.path)
    assert set(model.kinematics.links) <= set(changed.links)
    if effect == "payload":
        assert changed.masses["shank"] == pytest.approx(0.08)
    MakeStation(model)


@pytest.mark.parametrize("name", ["robot.urdf", "robot.sdf"])
def test_effects_act_on_a_robot_with_meshes(tmp_path: Path, name: str) -> None:
    _box_mesh(tmp_path / "box.stl")
    _box_mesh(tmp_path / "box.obj")
    mesh = "<mesh><uri>box.obj</uri><scale>.001 .001 .001</scale></mesh>"
    text = _meshed("box.stl") if name == "robot.urdf" else SDF.replace("<box><size>.02 .02 .05</size></box>", mesh)
    model = RobotModel(str(_robot(tmp_path, text, name)))
    joint = model.joints[-1]
    MakeStation(model.with_effect(EffectSpec("backlash", (joint,), {"gap": 3.0})))


@pytest.mark.parametrize("uri", ["mesh/trunk.stl", "mesh\\trunk.stl", "package://dog/mesh/trunk.stl", "package://dog//mesh/trunk.stl",
                                 "package:///mesh/trunk.stl",
                                 "file://{folder}/mesh/trunk.stl", "package://kit/trunk.stl", "mesh/trunk.dae"])
def test_meshes_are_found_and_converted(tmp_path: Path, uri: str) -> None:
    folder = tmp_path / "dog"
    stl = _box_mesh(folder / "mesh" / "trunk.stl")
    if uri.endswith(".dae"):
        with warnings.catch_warnings(action="ignore", category=DeprecationWarning):  # pycollada 0.9 under numpy 2.5, as it writes
            trimesh.load_mesh(stl).export(folder / "mesh" / "trunk.dae")
    path = _robot(folder / "urdf" if "package://" in uri else folder, _meshed(uri.format(folder=folder)))
    packages = {"kit": str(folder / "mesh")} if "kit" in uri else {}
    model = RobotModel(str(path), packages=packages)
    assert any("made OBJ for Drake" in note for note in model.source.notes)
    assert model.problems == ()
    said = inspect_file(path, packages)
    assert said.problems == ()
    assert "2 " in said.details["for Drake"]


def test_a_mesh_that_is_not_there_is_named_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"link 'trunk': mesh 'package://other/x.stl': file not found; .*--package other=DIR"):
        inspect_file(_robot(tmp_path, _meshed("package://other/x.stl")))
    (tmp_path / "broken.stl").write_bytes(b"solid nothing")
    with pytest.raises(InputError, match=r"mesh 'broken.stl'"):
        inspect_file(_robot(tmp_path, _meshed("broken.stl")))


@pytest.mark.parametrize(("old", "new", "said"), [
    ('value="0.5"', 'value="0"', "the base floats and weighs nothing"),
    ('ixx="3e-5" iyy="3e-5"', 'ixx="1" iyy="1"', "link 'shank': an inertia of"),
    ('ixx="3e-5" iyy="3e-5" izz="3e-6"', 'ixx="3e-5" iyy="3e-6" izz="3e-6"', "link 'shank': no body has principal moments"),
    ('value="0.03"', 'value="30"', "link 'shank' weighs 30 kg"),
    ('xyz="0 0 -0.1"', 'xyz="0 0 -100"', "are lengths in millimetres"),
    ('lower="-1.5"', 'lower="0.3"', "joint 'hip': zero lies outside its limits, 17.19 to 85.94 deg"),
    ('lower="-1.5" upper="1.5"', 'lower="-90" upper="90"', "are they in degrees"),
    ('<dynamics damping="0.01" friction="0.02"/>', '<mimic joint="hip"/>', "joint 'knee' mimics 'hip'"),
    ('value="0.03"', 'value="0"', "link 'shank' has no mass"),
    ('ixx="4e-4" iyy="7e-4" izz="9e-4"', 'ixx="0" iyy="0" izz="0"', "link 'trunk' weighs 0.5 kg and has no rotational inertia"),
    ('lower="-2" upper="2"', 'lower="0" upper="0"', "joint 'knee': its limits are equal"),
])
def test_what_is_doubtful_is_told(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in ROBOT
    problems = RobotModel(str(_robot(tmp_path, ROBOT.replace(old, new, 1)))).problems
    assert any(said in p for p in problems), problems


def test_a_robot_without_shapes_has_nothing_to_stand_on(tmp_path: Path) -> None:
    text = ROBOT.replace("<collision>", "<visual>").replace("</collision>", "</visual>")
    assert any("no link has a collision shape" in p for p in RobotModel(str(_robot(tmp_path, text))).problems)


def test_an_impossible_inertia_is_drakes_ball_of_water(tmp_path: Path) -> None:
    """The message names the replacement."""
    path = _robot(tmp_path, ROBOT.replace('ixx="3e-5" iyy="3e-5" izz="3e-6"', 'ixx="3e-5" iyy="3e-6" izz="3e-6"', 1))
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(prepare(path).path))
    plant.Finalize()
    shank = plant.GetBodyByName("shank")
    radius = (0.03 / 1000 / (4 / 3 * np.pi)) ** (1 / 3)
    center = shank.default_com()
    about = shank.default_rotational_inertia().CopyToFullMatrix3()
    moments = about - 0.03 * (center @ center * np.eye(3) - np.outer(center, center))
    np.testing.assert_allclose(moments, 0.4 * 0.03 * radius**2 * np.eye(3), rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(center, [0, 0, -0.04], atol=1e-12)


@pytest.mark.parametrize(("old", "new", "said"), [
    ('lower="-1.5" upper="1.5"', 'lower="1.5" upper="-1.5"', "joint 'hip': lower limit 1.5 is above"),
    ('value="0.5"', 'value="-0.5"', "link 'trunk': mass -0.5 kg"), ('value="0.5"', 'value="nan"', "link 'trunk': mass"),
    ('xyz="0 1 0"', 'xyz="0 1"', "joint 'hip': xyz: expected 3"), ('size="0.12', 'size="0,12', "link 'trunk': size"),
    ('<child link="shank"/>', '<child link="thigh"/>', "link 'thigh' hangs on joints 'hip' and 'knee'"),
    ('<parent link="thigh"/>', '<parent link="shank"/>', "kinematic loop"), ("</robot>", "", "not whole XML"),
    ('type="revolute"', 'type="floating"', "joint 'hip' is floating"), ("<?xml", "<!DOCTYPE x><?xml", "DOCTYPE"),
    ('<parent link="trunk"/>', '<parent link="nobody"/>', "no link 'nobody'"),
])
def test_what_cannot_be_built_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in ROBOT
    with pytest.raises(InputError, match=said) as raised:
        inspect_file(_robot(tmp_path, ROBOT.replace(old, new, 1)))
    assert "bazel" not in str(raised.value)
    assert str(raised.value).startswith(str(tmp_path / "robot.urdf"))


@pytest.mark.parametrize(("content", "said"), [
    (SDF.replace('name="a"', 'name="b\u00f6se"').encode("latin-1"), "not whole XML"),
    (SDF.replace("<mass>.1</mass>", "<mass>inf</mass>").encode(), "link 'a': mass"),
    (SDF.replace("<link name=\"r\">", '<include><uri>robot.sdf</uri></include><link name="r">').encode(), "includes itself"),
    (SDF.replace("<child>a</child>", "<child>r</child>").encode(), "loop|Drake cannot read"),
    (SDF.replace("<box><size>.02 .02 .05</size></box>", "<mesh><uri>nope.obj</uri></mesh>").encode(),
     "mesh 'nope.obj': file not found"),
    (b"\xff\xfe" + SDF.encode("utf-16-le")[:40], "robot.sdf"), (b"<sdf>" * 5000, "robot.sdf"), (b"<html></html>", "found <html>"),
])
def test_descriptions_that_are_none(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "robot.sdf").write_bytes(content)
    with pytest.raises(InputError, match=said):
        _ = RobotModel(str(tmp_path / "robot.sdf")).problems


def test_sdfs_default_mass_is_told(tmp_path: Path) -> None:
    i, j = SDF.index("<inertial><mass>.1"), SDF.index("</inertial>", SDF.index("<mass>.1")) + len("</inertial>")
    problems = RobotModel(str(_robot(tmp_path, SDF[:i] + SDF[j:], "robot.sdf"))).problems
    assert any("link 'a' has no <inertial>" in p for p in problems)


def test_the_puppy_is_read_as_it_stands() -> None:
    model = RobotModel("package://puppy/puppy.sdf")
    assert (model.path, model.source.notes, model.problems) == (model.source.source, (), ())
    assert model_problems(model.path, model.path) == ()


def test_one_folder_of_the_users_cache_keeps_models_and_compiled_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    found = RobotModel(str(_robot(tmp_path))).path
    assert found.parent == tmp_path / "cache" / "drake-workbench" / "models"
    assert kernel.cache_folder.__wrapped__().parent == tmp_path / "cache" / "drake-workbench"


def test_what_a_held_base_weighs_is_no_matter(tmp_path: Path) -> None:
    base, _, rest = SDF.partition("<link name=\"a\">")
    bare = base[:base.index("<inertial>")] + "</link><link name=\"a\">" + rest
    model = RobotModel(str(_robot(tmp_path, bare, "robot.sdf")))
    assert any("has no <inertial>" in text for text in model.problems)
    assert all("link 'r'" in text or text.startswith("no link") for text in model.problems)
    assert model.held_problems == ()
