"""Robots whose arrays and pose at rest are kept give the takes that fresh ones give, bit for bit."""

import numpy as np

from tests.simulation_compiled.test_compiled_touching import pressing
from workbench.gait.ensemble import load_ensemble
from workbench.gait.evaluate import SEARCH
from workbench.gait.machine import GaitMachine
from workbench.gait.rollouts import Rollouts
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table
from workbench.motion import load_motion
from workbench.robot import data_file, puppy_model
from workbench.simulation import Job
from workbench.simulation.compiled import run_compiled


def test_a_kept_robot_plays_as_a_fresh_one(tmp_path):
    model = puppy_model()
    walk = load_motion(data_file("robotis_walk.csv"), model).commands(1)
    (draw,) = load_ensemble().draws(model, 1, 0, tmp_path)
    kept = Rollouts(1)
    jobs = [Job(m, SEARCH, walk, 0.5, 0.03) for m in (model, draw)]
    list(kept.takes(jobs))
    for job, take, servos in zip(jobs, kept.takes(jobs), Rollouts(2).takes(jobs, as_seen=False)):
        fresh = run_compiled(job)
        for name in ("q", "v", "torque", "p_WB", "quat_WB"):
            np.testing.assert_array_equal(getattr(take, name), getattr(fresh, name), err_msg=name)
        np.testing.assert_array_equal(servos.p_WB, fresh.p_WB)
        np.testing.assert_array_equal(servos.torque, fresh.torque)


def test_a_gait_that_trips_over_itself_is_given_up_whatever_shapes_touch():
    """The compiled station itself would play it."""
    job = pressing("fixed", duration=0.5)
    assert run_compiled(job) is not None
    assert list(Rollouts(1).takes([job])) == [None]


def test_two_threads_give_what_one_gives():
    """Jobs of one robot share its arrays, but no thread's scratch memory."""
    model = puppy_model()
    machine = GaitMachine(model)
    tables = [gait_table(machine, GaitShape("trot", (1, 1), 8, 2.2, stride=stride, duty=0.6, lift=0.02, crouch=0.04, lead=1.0))
              for stride in (0.03, 0.04, 0.05, 0.06)]
    jobs = [Job(model, SEARCH, t.commands(3), t.start_seconds + 3 * t.period, 0.03) for t in tables]
    alone, together = ([take.p_WB for take in Rollouts(n).takes(jobs)] for n in (1, 2))
    for one, two in zip(alone, together):
        np.testing.assert_array_equal(one, two)
