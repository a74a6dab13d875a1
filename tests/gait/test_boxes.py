"""Random boxes on the floor: the same for the same seed, met by feet, and Drake's alone."""

from dataclasses import replace

import numpy as np

from workbench.motion import load_motion
from workbench.robot import data_file, puppy_model
from workbench.simulation import Job, SimulationConfig, simulate_batch
from workbench.simulation.compiled import covers


def test_boxes_shake_the_robot_and_are_the_same_for_the_same_seed():
    model = puppy_model()
    commands = load_motion(data_file("robotis_walk.csv"), model).commands(2)
    level = SimulationConfig(time_step=2e-3, contact_period=0.0, log_period=0.01, settle=0.2, engine="drake")
    rough = replace(level, boxes=0.01)
    flat, one, again = simulate_batch([Job(model, c, commands, 0.8) for c in (level, rough, rough)], 1)
    np.testing.assert_array_equal(one.q, again.q)
    np.testing.assert_allclose(one.p_WB[0], flat.p_WB[0], atol=1e-9)  # none where it stands
    assert covers(Job(model, replace(rough, engine="auto"), commands)) == "boxes on the floor"


def test_a_foot_on_a_box_stands_higher(monkeypatch):
    monkeypatch.setattr("workbench.simulation.boxes.CLEAR", 0.0)
    model = puppy_model()
    level = SimulationConfig(time_step=2e-3, contact_period=0.0, log_period=0.01, settle=0.2, engine="drake")
    flat, rough = (simulate_batch([Job(model, replace(level, boxes=h, boxes_seed=1), None, 0.1)], 1)[0] for h in (0.0, 0.01))
    assert rough.p_WB[-1, 2] - flat.p_WB[-1, 2] > 0.001
