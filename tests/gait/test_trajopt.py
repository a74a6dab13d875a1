"""The kino-centroidal programme."""

import numpy as np
import pytest

from workbench.gait.machine import GaitMachine
from workbench.gait.planned import bundled_tasks
from workbench.gait.shape import GaitShape
from workbench.gait.trajopt import FRICTION_SHARE, Task, plan
from workbench.robot import GRAVITY, SPEED_UNIT, puppy_model


@pytest.fixture(scope="module")
def planned():
    machine = GaitMachine(puppy_model())
    shape = GaitShape("trot", (1, 1), 8, 2.4, duty=0.6, lift=0.02, crouch=0.04)
    return machine, plan(machine, Task("trot", shape, (0.1, 0.0)))


def test_a_trot_is_solved_and_carries_the_robot(planned):
    machine, p = planned
    assert p.solved
    weight = machine.model.kinematics.mass * GRAVITY
    assert p.forces[..., 2].sum(axis=1).mean() == pytest.approx(weight, rel=1e-3)  # it does not rise nor sink over a cycle
    assert np.abs(p.forces.sum(axis=1).mean(axis=0)[:2]).max() < 1e-3 * weight
    across = np.linalg.norm(p.forces[..., :2], axis=2)
    assert (across <= FRICTION_SHARE * 0.5 * p.forces[..., 2] + 1e-3).all()
    assert not p.forces[~p.stance].any()


def test_joints_stay_within_range_and_speed_and_feet_on_their_places(planned):
    machine, p = planned
    for i, joint in enumerate(machine.model.joints):
        assert (p.q[:, i] <= machine.ranges[joint].upper + 1e-6).all()
        assert (p.q[:, i] >= machine.ranges[joint].lower - 1e-6).all()
    step = np.abs(np.diff(p.q, axis=0, append=p.q[:1])) / (p.task.shape.period / len(p.q))
    assert (step <= machine.fastest * SPEED_UNIT + 1e-3).all()
    for i, leg in enumerate(machine.legs):  # in stance a foot goes back under the base by what the base advances
        columns = [machine.model.joints.index(j) for j in leg.joints]
        x = (leg.place(p.q[:, columns]) + p.p)[:, 0]
        both = p.stance[:, i] & np.roll(p.stance[:, i], -1)
        back = (np.roll(x, -1) - x)[both]
        np.testing.assert_allclose(back, -0.1 * p.task.shape.period / len(p.q), atol=2e-3)


def test_there_are_twenty_tasks_of_all_ways():
    tasks = bundled_tasks()
    assert len(tasks) == len({t.name for t in tasks}) == 20
    assert {t.shape.family for t in tasks} >= {"trot", "walk", "crawl", "pace"}
    assert any(t.slope for t in tasks)
    assert any(t.turn_rate for t in tasks)
    assert any(t.velocity[0] < 0 for t in tasks)
