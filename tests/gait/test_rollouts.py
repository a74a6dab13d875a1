"""Robots whose arrays and pose at rest are kept give the takes that fresh ones give, bit for bit."""

import numpy as np

from tests.simulation_compiled.test_compiled_touching import pressing
from workbench.gait.ensemble import load_ensemble
from workbench.gait.evaluate import SEARCH
from workbench.gait.rollouts import Rollouts
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
