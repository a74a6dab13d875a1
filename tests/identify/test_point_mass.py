"""Sizes of a mass that a link carries."""

import numpy as np
import pytest

from workbench.effects.registry import known_effects
from workbench.identify.conclusions import estimates
from workbench.identify.options import CONCLUSIONS, FIT
from workbench.identify.point_mass import PointMass, SwungMass, point_mass
from workbench.robot import RobotModel
from workbench.robot.kinematics import Kinematics

ROD = """<sdf version="1.9"><model name="rig">
  <link name="stand"><inertial><mass>1</mass></inertial></link>
  <link name="rod"><pose>0 0.03 0.2 0 0 0</pose><inertial><pose>0 0.01 -0.05 0 0 0</pose><mass>0.1</mass></inertial></link>
  <joint name="swing" type="revolute"><parent>stand</parent><child>rod</child><pose>0.01 0 0 0 0 0</pose>
    <axis><xyz>0 1 0</xyz></axis></joint>
</model></sdf>"""


@pytest.fixture
def rod(tmp_path) -> Kinematics:
    path = tmp_path / "rig.sdf"
    path.write_text(ROD)
    return RobotModel(description=str(path), base="stand").kinematics


def payload(rod, held):
    return point_mass(known_effects()["payload"], "rod", rod, base_is_held=held)


def test_what_swings_about_a_held_axis_is_sought_from_that_axis_on(rod):
    """Of mass m at p, gravity tells m p across the axis, inertia m p^2: a distance that doubles halves the mass."""
    c = payload(rod, held=True)
    assert isinstance(c, SwungMass)
    assert c.size == 3
    assert len(c.probes()) == 2
    axis_at = np.array([0.01, 0.01, 0.0])  # where the joint is, as far along it as the centre of mass
    for doublings in (0.0, 1.0, -2.0):
        for x in (*c.probes(), np.array([0.0, 3.0, -4.0])):
            mass, *at = c.values(np.array([doublings, *x[1:]]))
            arm = np.array(at) - axis_at
            assert arm[1] == pytest.approx(0.0)
            assert np.linalg.norm(arm) == pytest.approx(FIT.swung_distance * 2**doublings)
            assert mass * np.linalg.norm(arm) == pytest.approx(0.05 * 0.02 * np.linalg.norm(x[1:]))
    assert c.values(np.zeros(3))[0] == 0.0


def test_a_robot_that_stands_on_the_ground_feels_the_weight_too(rod):
    c = payload(rod, held=False)
    assert type(c) is PointMass
    assert c.size == 4


def test_where_along_its_axis_a_mass_swings_is_not_known(rod):
    c = payload(rod, held=True)
    x = np.array([0.0, 0.0, 4.0])
    told = estimates(c, x, np.diag([0.01, 0.0, 0.0]))
    mass, at = told["mass"], told["position"]
    assert (mass.high - mass.value) / mass.value == pytest.approx(CONCLUSIONS.z90 * CONCLUSIONS.wider * 0.1 * np.log(2), rel=1e-3)
    assert np.isinf(at.high[1])
    assert np.isfinite(at.high[0])
    assert np.isfinite(at.high[2])
    blind = estimates(c, x, np.diag([np.inf, 0.01, 0.01]))
    assert np.isinf(blind["mass"].high)
    assert np.isinf(blind["position"].high).sum() == 2


def test_how_high_a_load_sits_is_told_by_moves_as_long_as_its_arm(rod):
    """A height near nothing is moved by as much as what lies ahead, not by a share of itself."""
    c = payload(rod, held=False)
    mass, ahead, left, up = c.magnitudes(np.array([4.0, -12.0, 9.0, 0.1]))
    assert (mass, ahead, left) == (4.0, 12.0, 9.0)
    assert up == pytest.approx(0.5 * np.linalg.norm([12.0, 9.0, 0.1]))
    alone = payload(rod, held=True).magnitudes(np.array([0.1, 0.2, 2.0]))
    assert alone == pytest.approx([0.3, 0.5 * np.linalg.norm([0.2, 2.0]), 2.0])  # how far away it is is no part of the moments
