"""Which links are feet: by default, as listed, and on a robot whose names are not the puppy's."""

from pathlib import Path

import pytest

from models import build_fox, fox_trot
from workbench.files import InputError
from workbench.robot import RobotModel, data_file, foot_points, legs, load_model, puppy_model, resolve_model, save_model

FOX = "package://fox/fox.sdf"
TWO_TOES = """<sdf version="1.9"><model name="m"><link name="base"/><link name="shank"/>
<link name="heel"><collision name="c"><geometry><sphere><radius>0.01</radius></sphere></geometry></collision></link>
<link name="toe"><collision name="c"><geometry><sphere><radius>0.01</radius></sphere></geometry></collision></link>
<joint name="knee" type="revolute"><parent>base</parent><child>shank</child><axis><xyz>0 1 0</xyz></axis></joint>
<joint name="a" type="fixed"><parent>shank</parent><child>heel</child></joint>
<joint name="b" type="fixed"><parent>shank</parent><child>toe</child></joint>{mount}</model></sdf>"""
MOUNT = '<joint name="mount" type="fixed"><parent>world</parent><child>base</child></joint>'


def test_the_puppy_stands_on_its_shanks():
    assert dict(puppy_model().foot_links) == {k: f"{k}_link" for k in ("blb", "brb", "flb", "frb")}


def test_a_welded_foot_has_the_name_of_the_joint_that_moves_it():
    fox = RobotModel(FOX)
    assert fox.base == "trunk"
    assert dict(fox.foot_links) == {f"{leg}_KFE": f"{leg}_FOOT" for leg in ("LF", "LH", "RF", "RH")}
    assert legs(fox)["RH_KFE"] == ("RH_HAA", "RH_HFE", "RH_KFE")
    points, radii = foot_points(fox)["LF_KFE"]
    assert points.shape == (1, 3)
    assert radii == pytest.approx(build_fox.FOOT_RADIUS)


def test_two_feet_of_one_joint_have_their_links_names(tmp_path):
    path = tmp_path / "toes.sdf"
    path.write_text(TWO_TOES.format(mount=""))
    assert dict(RobotModel(str(path)).foot_links) == {"heel": "heel", "toe": "toe"}
    assert dict(RobotModel(str(path), feet=("toe",)).foot_links) == {"knee": "toe"}
    path.write_text(TWO_TOES.format(mount=MOUNT))
    assert not RobotModel(str(path)).foot_links, "a robot that is mounted on the world stands on no feet"


def test_listed_feet_come_back_from_a_file_and_bad_ones_are_named(tmp_path):
    fox = RobotModel(FOX, feet=("LF_FOOT", "RF_FOOT"))
    assert dict(load_model(save_model(fox, tmp_path / "model.yaml")).foot_links) == {"LF_KFE": "LF_FOOT", "RF_KFE": "RF_FOOT"}
    path = tmp_path / "session.yaml"
    for feet, problem in (("[paw]", "feet: the model has no link 'paw'"), ("[LF_FOOT, LF_FOOT]", "feet: expected a list")):
        path.write_text(f"format: 1\nrobot: {{model: '{FOX}', feet: {feet}}}\n")
        with pytest.raises(InputError, match=problem) as raised:
            load_model(path)
        assert str(path) in str(raised.value)
    with pytest.raises(InputError, match="no link 'paw'"):
        _ = RobotModel(FOX, feet=("paw",)).foot_links


def test_what_ships_is_what_the_scripts_make(tmp_path):
    folder = resolve_model(FOX).parent
    build_fox.build(tmp_path)
    for name in ("fox.sdf", "package.xml"):
        assert (tmp_path / name).read_text() == (folder / name).read_text()
    assert Path(data_file("fox/trot.csv")).read_text() == fox_trot.table()
