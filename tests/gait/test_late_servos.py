"""Servos that are each late by a delay of their own."""

from dataclasses import replace

import numpy as np

from workbench.effects.apply import apply_to_commands
from workbench.motion import load_motion
from workbench.robot import EffectSpec, data_file, puppy_model


def test_each_servo_gets_its_poses_late_by_its_own_delay_without_instants_that_change_nothing():
    model = puppy_model()
    commands = load_motion(data_file("robotis_walk.csv"), model).commands(3)
    delays = {j: 0.017 + 0.002 * i for i, j in enumerate(model.joints)}
    late = apply_to_commands(commands, replace(model, effects=tuple(
        EffectSpec("command_delay", (j,), {"delay": d}) for j, d in delays.items())))
    assert len(late.times) <= len(commands.times) * (len(model.joints) + 1)
    at = np.linspace(0.0, commands.end, 700)
    for i, j in enumerate(model.joints):
        reference = commands.reference(at)[:, i]
        np.testing.assert_allclose(late.reference(at + delays[j])[:, i], reference, atol=1e-9, err_msg=j)
