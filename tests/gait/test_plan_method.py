"""Gaits by trajectory optimisation: the programme's own joint path as a table, and what its bodies do."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.files import InputError
from workbench.gait.evaluate import SEARCH, Evaluator
from workbench.gait.machine import GaitMachine
from workbench.gait.plan_compare import compare_plan
from workbench.gait.plan_method import Plans, choose_plan, plan_entry
from workbench.gait.planned import table_shape, tasks_of
from workbench.gait.request import Request
from workbench.gait.rollouts import Rollouts
from workbench.gait.shape import GaitShape
from workbench.gait.space import space_of
from workbench.gait.table import gait_table, paths_of
from workbench.gait.trajopt import plan
from workbench.robot import puppy_model
from workbench.simulation import Job


@pytest.fixture(scope="module")
def planned():
    machine, request = GaitMachine(puppy_model()), Request(speed=0.1)
    solved = plan(machine, tasks_of(request, machine)[0])
    assert solved.solved
    return machine, request, solved, table_shape(machine, solved)


def test_the_table_goes_through_the_planned_joint_path(planned):
    machine, _, solved, shape = planned
    (paths,) = paths_of(machine, [shape])
    np.testing.assert_allclose(paths.q, np.roll(solved.q, -1, axis=0), atol=1e-12)
    assert np.abs(np.array(shape.offsets)).max() > 1e-3  # what the nearest foot path does not have
    again = GaitShape.from_plain({**vars(shape), "offsets": [list(row) for row in shape.offsets]})
    assert again == shape


def test_it_walks_nearly_as_fast_as_planned_and_its_bodies_are_near(planned):
    machine, request, solved, shape = planned
    evaluator = Evaluator(machine, request, (), n_jobs=1)
    plans = Plans({shape.offsets: solved}, (shape,), 1)
    found = choose_plan(evaluator, plans, lambda what, done: None)
    assert found is not None
    told = plan_entry(found.best, plans)["planned"]
    assert 0.8 < told["share of it"] < 1.15
    table = gait_table(machine, shape)
    job = Job(machine.model, SEARCH, table.commands(5), table.start_seconds + 5 * table.period, 0.3)
    (take,) = Rollouts(1).takes([job])
    compared = compare_plan(machine, solved, table, take, 5)
    assert set(compared.errors) == set(machine.model.rigid_bodies)
    assert max(e.position for e in compared.errors.values()) < 0.02
    assert max(e.rotation for e in compared.errors.values()) < np.radians(12)
    assert 0.8 < compared.speed < 1.15
    assert 0 < min(compared.feet.values()) < 0.02
    slower = replace(solved, task=replace(solved.task, velocity=(0.3, 0.0)))  # a plan that the robot does not keep up with
    assert compare_plan(machine, slower, table, take, 5).errors["body"].position > 1.5 * compared.errors["body"].position


def test_plans_are_asked_for_in_the_direction_of_the_request():
    machine = GaitMachine(puppy_model())
    assert {np.sign(t.velocity[0]) for t in tasks_of(Request("backward", 0.1), machine)} == {-1.0}
    assert {np.sign(t.turn_rate) for t in tasks_of(Request("turn", 0.5, right=True), machine)} == {-1.0}
    assert {t.shape.knees for t in tasks_of(Request(speed=0.1, built_knees=True), machine)} == {(1, 1)}


def test_offsets_of_another_number_of_poses_are_refused(planned):
    machine, request, _, shape = planned
    with pytest.raises(InputError, match="offsets: expected 8 rows"):
        gait_table(machine, replace(shape, poses=8))
    assert space_of(machine, request).point(shape).shape == (len(space_of(machine, request).names),)
