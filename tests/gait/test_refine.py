"""Gauss-Newton on a gait's angles: mirror symmetry, and a gait that is better afterwards."""

import math
from dataclasses import replace

import numpy as np
import pytest

from workbench.files import InputError
from workbench.gait.evaluate import Evaluator
from workbench.gait.limits import Margin
from workbench.gait.machine import GaitMachine
from workbench.gait.refine import RefineOptions, gauss_newton, refined
from workbench.gait.request import Request
from workbench.gait.search import Found
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table
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


def test_parts_of_a_change_that_breaks_a_limit_are_tried_and_kept_in_order(evaluator, better, monkeypatch):
    offsets = np.array(better.offsets)

    class Strict(Evaluator):
        """Refuses whole changes, and calls the rest the faster the larger the change."""

        def judged(self, shapes, draws, keep=None):
            out = []
            for s in shapes:
                part = np.abs(np.array(s.offsets)).max() / np.abs(offsets).max() if s.offsets else 0.0
                limit = Margin("foot clearance over draws", "robot", 2.0, 3.0, "mm", 1.3 if part > 0.9 else 0.5)
                out.append(replace(start, table=gait_table(self.machine, s), margins=(limit,), cost=1.0 - part))
            return out

    (start,) = evaluator.judged([SHAPE], 0)
    start = replace(start, margins=(), cost=1.0)
    monkeypatch.setattr("workbench.gait.refine.gauss_newton", lambda *_: better)
    strict = Strict(evaluator.machine, Request(), (), n_jobs=1)
    found = refined(strict, Found(start, None, 0, 0), replace(SMALL, parts=(1.0, 0.6, 0.3)), silent)
    assert [round(c.cost, 2) for c in (found.best, *found.others)] == [0.4, 0.7, 1.0]


def test_options_out_of_range_are_refused():
    with pytest.raises(InputError, match="probe"):
        RefineOptions(probe=0.0)
