"""Stance and footfalls of a leg whose lifts are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from workbench.compare.footfalls import foot_heights, foot_phases, force_phases
from workbench.recording.take import Take
from workbench.robot import RobotModel, foot_points

FOOT = '<collision name="{}"><pose>0 0 {} 0 0 0</pose><geometry>{}</geometry></collision>'
SDF = """<?xml version="1.0"?><sdf version="1.7"><model name="hopper">
<link name="body_link"><pose>0 0 0.11 0 0 0</pose><inertial><mass>1</mass></inertial></link>
<link name="flb_link"><pose>0 0 0.11 0 0 0</pose><inertial><mass>0.1</mass></inertial>{feet}</link>
<joint name="flb" type="revolute"><parent>body_link</parent><child>flb_link</child><axis><xyz>0 1 0</xyz><limit><lower>-2</lower>
<upper>2</upper></limit></axis></joint></model></sdf>"""


@pytest.fixture
def model(tmp_path) -> RobotModel:
    path = tmp_path / "hopper.sdf"
    path.write_text(SDF.format(feet=FOOT.format("foot", -0.1, "<sphere><radius>0.01</radius></sphere>")))
    return RobotModel(description=str(path))


def walk(lifted: np.ndarray, time: np.ndarray, noise: float = 0.0) -> Take:
    """The leg bends by 0.6 rad where `lifted`; the base stays where it is, turned about up and shifted."""
    rng = np.random.default_rng(0)
    n = len(time)
    q = np.where(lifted, 0.6, 0.0)[:, None] + rng.normal(0, noise, (n, 1))
    return Take(name="walk", source="recording", time=time, joints=("flb",), q=q, starts_at=0.5, zeroed=True,
                p_WB=np.column_stack([0.1 * time, 0 * time, 0 * time + 0.11]) + rng.normal(0, noise / 20, (n, 3)),
                quat_WB=np.tile([np.cos(0.4), 0, 0, np.sin(0.4)], (n, 1)))


def test_height_of_the_lowest_point(model):
    time = np.arange(0, 1, 0.01)
    z = foot_heights(walk(time > 0.7, time), model)["flb"]
    np.testing.assert_allclose(z[time <= 0.7], 0.0, atol=1e-12)
    np.testing.assert_allclose(z[time > 0.7], 0.1 - 0.1 * np.cos(0.6), atol=1e-12)


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_duty_factor_and_footfalls(model, noise):
    time = np.arange(0, 4.5, 1 / 120)
    lifted = (time > 0.5) & (np.mod(time - 0.5, 0.8) < 0.24)  # five strides of 0.8 s, 30 % in the air
    phases = foot_phases(walk(lifted, time, noise), model)["flb"]
    assert phases.duty == pytest.approx(0.7, abs=0.02)
    np.testing.assert_allclose(phases.falls, 0.5 + 0.24 + 0.8 * np.arange(5), atol=0.03)
    assert phases.known.all()


def test_what_was_not_seen_is_not_counted(model):
    time = np.arange(0, 4.5, 1 / 120)
    lifted = (time > 0.5) & (np.mod(time - 0.5, 0.8) < 0.24)
    take = walk(lifted, time)
    take.q[(time > 1.25) & (time < 1.6)] = np.nan  # a lift that nobody saw
    phases = foot_phases(take, model)["flb"]
    assert len(phases.falls) == 4
    assert not phases.known[(time > 1.26) & (time < 1.59)].any()


def test_chatter_is_no_step(model):
    time = np.arange(0, 2, 1 / 120)
    lifted = (time > 0.9) & (time < 0.92) | (time > 1.2) & (time < 1.5)
    assert len(foot_phases(walk(lifted, time), model)["flb"].falls) == 1


def test_no_feet_no_phases(model):
    time = np.arange(0, 1, 0.01)
    take = walk(time > 0.7, time)
    assert foot_phases(replace(take, base="fixed"), model) == {}
    assert foot_phases(replace(take, p_WB=None), model) == {}
    assert foot_phases(replace(take, joints=("other",)), model) == {}


def test_phases_from_forces(model):
    time = np.arange(0, 2, 0.01)
    load = np.where((time > 1) & (time < 1.4), 0.0, 8.0)
    take = replace(walk(time < 0, time), contact={"flb": np.column_stack([0 * load, 0 * load, load])})
    phases = force_phases(take)["flb"]
    np.testing.assert_allclose(phases.falls, [1.4], atol=0.011)
    assert phases.duty == pytest.approx(1.1 / 1.5, abs=0.02)
    assert force_phases(replace(take, contact={})) == {}


def test_points_of_a_box(tmp_path):
    path = tmp_path / "box.sdf"
    path.write_text(SDF.format(feet=FOOT.format("pad", -0.1, "<box><size>0.04 0.02 0.01</size></box>")))
    points, radii = foot_points(RobotModel(str(path)))["flb"]
    np.testing.assert_allclose(points.min(axis=0), [-0.02, -0.01, -0.105], atol=1e-12)
    np.testing.assert_allclose(points.max(axis=0), [0.02, 0.01, -0.095], atol=1e-12)
    assert not radii.any()
