"""Legs found in a model, and angles that put feet where they should be."""

from pathlib import Path

import numpy as np
import pytest

from studies.concealed_effects.robots import quadruped
from workbench.files import InputError
from workbench.gait.legs import legs_of
from workbench.robot import RobotModel, puppy_model


@pytest.mark.parametrize("name", ["puppy", "another quadruped"])
@pytest.mark.parametrize("bend", [1, -1])
def test_the_foot_is_where_it_was_asked_and_the_knee_points_as_asked(name, bend, tmp_path):
    model = puppy_model() if name == "puppy" else quadruped(np.random.default_rng(0)).model(tmp_path / "robot.sdf")
    rng = np.random.default_rng(0)
    legs = legs_of(model)
    assert {leg.foot for leg in legs} == {"blb", "brb", "flb", "frb"}
    for leg in legs:
        assert [j[-1] for j in leg.joints] == ["t", "m", "b"]  # the tail moves two feet and belongs to neither leg
        side = np.sign(leg.neutral[1])
        targets = leg.neutral + np.column_stack([
            rng.uniform(-0.06, 0.06, 50), side * rng.uniform(-0.02, 0.03, 50), rng.uniform(0.02, 0.07, 50)])
        q, off = leg.solve(targets, bend)
        assert off.max() < 1e-6
        poses = model.kinematics.forward(q, leg.joints)
        p, R = poses[leg.link]
        np.testing.assert_allclose(p + R @ leg.tip, targets, atol=1e-6)
        knee = model.kinematics.frames[leg.joints[-1]]
        hip = model.kinematics.frames[leg.joints[-2]]
        p_knee, p_hip = poses[knee.child][0], poses[hip.child][0]
        ahead = np.cross(targets - p_hip, p_knee - p_hip)[:, 1]  # positive where the knee is behind the line from hip to foot
        assert (np.sign(ahead) == bend).all()


def test_a_target_out_of_reach_is_told_by_how_far_it_stays_off():
    leg = legs_of(puppy_model())[0]
    _, off = leg.solve(leg.neutral[None] - [[0, 0, 0.03]], 1)
    assert off[0] == pytest.approx(0.03, abs=0.002)


def test_a_robot_without_feet_cannot_walk(tmp_path: Path):
    path = tmp_path / "bare.sdf"
    path.write_text('<sdf version="1.9"><model name="bare"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
                    "<parent>a</parent><child>b</child><axis><xyz>0 1 0</xyz></axis></joint></model></sdf>")
    with pytest.raises(InputError, match="no foot"):
        legs_of(RobotModel(str(path), base="a"))
