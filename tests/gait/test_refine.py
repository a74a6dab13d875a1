"""Gauss-Newton on a gait's angles: mirror symmetry, and a gait that is better afterwards."""

import math
from dataclasses import replace

import numpy as np
import pytest

from workbench.files import InputError
from workbench.gait.evaluate import Evaluator
from workbench.gait.machine import GaitMachine
from workbench.gait.refine import RefineOptions, gauss_newton, refined
from workbench.gait.request import Request
from workbench.gait.search import Found
from workbench.gait.shape import GaitShape
from workbench.robot import puppy_model

SHAPE = GaitShape("trot", (1, 1), 8, 2.2, stride=0.06, duty=0.6, lift=0.02, crouch=0.04, lead=1.0)
SMALL = RefineOptions(robots=0, harmonics=1)


def silent(what, done):
    pass


@pytest.fixture(scope="module")
def evaluator():
    return Evaluator(GaitMachine(puppy_model()), Request(), (), n_jobs=1, seconds=1.0)


@pytest.fixture(scope="module")
def better(evaluator):
    return gauss_newton(evaluator, SHAPE, SMALL, silent)


def test_the_gait_is_faster_and_no_joint_moved_far(evaluator, better):
    before, after = evaluator.measured([(SHAPE, evaluator.nominal), (better, evaluator.nominal)])
    assert after.speed > 1.1 * before.speed
    assert not after.fell
    assert 0.2 < math.degrees(np.abs(np.array(better.offsets)).max()) < 15


def test_left_and_right_are_mirror_images_half_a_cycle_apart(evaluator, better):
    joints, offsets = evaluator.machine.model.joints, np.array(better.offsets)
    for left in (j for j in joints if j[:2] in ("fl", "bl")):
        right = left.replace("l", "r", 1) if left.startswith("fl") else "br" + left[2:]
        a, b = offsets[:, joints.index(left)], np.roll(offsets[:, joints.index(right)], -4)
        assert np.allclose(a, b) or np.allclose(a, -b)
    assert not offsets[:, joints.index("tail")].any()


def test_what_does_not_go_straight_is_left_as_it_is(evaluator):
    (candidate,) = evaluator.judged([SHAPE], 0)
    found = Found(candidate, None, 0, 0)
    turning = Evaluator(evaluator.machine, Request("turn", 0.5), (), n_jobs=1)
    assert refined(turning, found, SMALL, silent) is found
    assert refined(evaluator, found, replace(SMALL, iterations=0), silent) is found


def test_options_out_of_range_are_refused():
    with pytest.raises(InputError, match="probe"):
        RefineOptions(probe=0.0)
