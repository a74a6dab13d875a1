"""Slip and clearance of feet whose motion is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from workbench.gait.feet import feet_measure
from workbench.gait.legs import legs_of
from workbench.recording.take import Take
from workbench.robot import puppy_model


def test_a_robot_that_is_dragged_slips_at_its_speed_and_one_that_hops_clears_by_its_hop():
    model = puppy_model()
    legs = legs_of(model)
    t = np.arange(-0.2, 2.001, 0.01)
    height = -min(leg.neutral[2] for leg in legs)
    n = len(model.joints)

    def moved(x, z):
        return Take("body", "simulation", t, model.joints, np.zeros((len(t), n)), starts_at=0.0, v=np.zeros((len(t), n)),
                    p_WB=np.column_stack([x, 0 * t, height + z]), quat_WB=np.tile([1.0, 0, 0, 0], (len(t), 1)))

    on = np.maximum(t, 0)
    dragged = feet_measure(moved(0.1 * on, 0 * t), model, legs, 0.0, 0.5)
    assert dragged.slip == pytest.approx(0.1, rel=0.02)
    assert dragged.clearance == pytest.approx(0.0, abs=1e-9)
    hopping = feet_measure(moved(0 * t, 0.01 * np.abs(np.sin(2 * np.pi * on))), model, legs, 0.0, 0.5)
    assert hopping.clearance == pytest.approx(0.01, rel=0.01)
    assert hopping.slip == pytest.approx(0.0, abs=1e-9)
    assert 0.1 < hopping.tipping < 0.6


def test_a_foot_that_rolls_does_not_slip():
    """The whole robot turns forward about the line on which its front feet stand, as a wheel of a foot's radius would."""
    model = puppy_model()
    legs = legs_of(model)
    t = np.arange(-0.2, 0.5, 0.01)
    n = len(model.joints)
    angle = 0.3 * np.maximum(t, 0)
    quat = np.column_stack([np.cos(angle / 2), 0 * t, np.sin(angle / 2), 0 * t])
    neutral = Take("body", "simulation", t, model.joints, np.zeros((len(t), n)), starts_at=0.0, v=np.zeros((len(t), n)),
                   p_WB=np.zeros((len(t), 3)), quat_WB=quat)
    front = max(legs, key=lambda leg: leg.neutral[0])
    poses = model.kinematics.forward(np.zeros((1, n)))[front.link]
    corner = max((poses[0][0] + poses[1][0] @ s for s in front.spheres), key=lambda p: p[0])
    R = Rotation.from_quat(quat, scalar_first=True).as_matrix()
    radius = float(front.radii[0])
    rolled = np.column_stack([radius * angle, 0 * t, np.full(len(t), radius)]) - R @ corner  # where the base is meanwhile
    take = replace(neutral, p_WB=rolled)
    front_legs = tuple(leg for leg in legs if leg.neutral[0] > 0)
    assert feet_measure(take, model, front_legs, 0.1, 0.3).slip < 1e-4
    slid = replace(neutral, p_WB=rolled + np.column_stack([0.05 * np.maximum(t, 0), 0 * t, 0 * t]))
    assert feet_measure(slid, model, front_legs, 0.1, 0.3).slip == pytest.approx(0.05, abs=1e-3)
