"""Slip and clearance of feet whose motion is known."""

import numpy as np
import pytest

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
