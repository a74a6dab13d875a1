"""Gauss-Newton on a gait's angles: mirror symmetry, and a gait that is better afterwards."""

import math
from dataclasses import replace

import numpy as np
import pytest

from workbench.files import InputError
from workbench.gait.evaluate import Evaluator
from workbench.gait.limits import Margin
from workbench.gait.machine import GaitMachine
from workbench.gait.measure import GaitMeasure, fallen
from workbench.gait.refine import FALLEN, Goal, RefineOptions, gauss_newton, refine
from workbench.gait.request import Request
from workbench.gait.search import Found
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table
from workbench.robot import EffectSpec, puppy_model

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
    before, after = evaluator.measure([(SHAPE, evaluator.nominal), (better, evaluator.nominal)])
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
    (candidate,) = evaluator.judge([SHAPE], 0)
    found = Found(candidate, None, 0, 0)
    turning = Evaluator(evaluator.machine, Request("turn", 0.5), (), n_jobs=1)
    assert refine(turning, found, SMALL, silent) is found
    assert refine(evaluator, found, replace(SMALL, iterations=0), silent) is found


def test_parts_of_a_change_that_breaks_a_limit_are_tried_and_kept_in_order(evaluator, better, monkeypatch):
    offsets = np.array(better.offsets)

    class Strict(Evaluator):
        """Refuses whole changes, and calls the rest the faster the larger the change."""

        def judge(self, shapes, draws, keep=None):
            out = []
            for s in shapes:
                part = np.abs(np.array(s.offsets)).max() / np.abs(offsets).max() if s.offsets else 0.0
                limit = Margin("foot clearance over draws", "robot", 2.0, 3.0, "mm", 1.3 if part > 0.9 else 0.5)
                out.append(replace(start, table=gait_table(self.machine, s), margins=(limit,), cost=1.0 - part))
            return out

    (start,) = evaluator.judge([SHAPE], 0)
    start = replace(start, margins=(), cost=1.0)
    monkeypatch.setattr("workbench.gait.refine.gauss_newton", lambda *_: better)
    strict = Strict(evaluator.machine, Request(), (), n_jobs=1)
    found = refine(strict, Found(start, None, 0, 0), replace(SMALL, parts=(1.0, 0.6, 0.3)), silent)
    assert [round(c.cost, 2) for c in (found.best, *found.others)] == [0.4, 0.7, 1.0]


WALKED = GaitMeasure(False, (0.3, 0.0), 0.0, 1.0, 0.0, 0.0, 0.1, (0.1,) * 15, (0.5,) * 15, (0.5,) * 15, 1.0, 2.0, 20.0, 5.0,
                     100.0, clearance=0.02, slip=0.01)


class Canned(Evaluator):
    """Results of each robot, whatever the shape."""

    def measure(self, runs):
        robots = (self.nominal, *self.draws)
        return [next(m for other, m in zip(robots, self.results) if other is robot) for _, robot in runs]


def goal_of(evaluator, nominal, draws, **options):
    robots = [evaluator.machine.model.with_effect(EffectSpec("ground_friction", (), {"friction": 0.4 + 0.02 * k}))
              for k in range(len(draws))]
    canned = Canned(evaluator.machine, evaluator.request, robots, n_jobs=1)
    canned.results = (nominal, *draws)
    return Goal.of(canned, SHAPE, RefineOptions(**options)), robots


def used(m, line, joint=3):
    return replace(m, torque_use=tuple(line if j == joint else 0.5 for j in range(15)))


def test_the_slowest_robots_stand_for_those_that_break_a_limit(evaluator):
    """The line is kept by the two slow robots and broken by a fast one: its residual is on the slow ones."""
    slow, fast = replace(WALKED, velocity=(0.2, 0.0)), replace(WALKED, velocity=(0.4, 0.0))
    kept = [used(slow, 0.80), used(slow, 0.82), used(fast, 0.60), used(fast, 0.70)]
    broken = [*kept[:3], used(fast, 1.10)]
    within, robots = goal_of(evaluator, WALKED, kept)
    beyond, _ = goal_of(evaluator, WALKED, broken)
    assert all(a is b for a, b in zip(within.robots[1:], robots[:2], strict=True))
    (r,), (s,) = within.residuals([SHAPE]), beyond.residuals([SHAPE])
    assert np.count_nonzero(r) == 3  # the speeds
    assert np.count_nonzero(s) == 5
    assert s.max() == pytest.approx(0.10 / np.std([0.80, 0.82, 0.60, 1.10]) + 1)


def test_what_varies_more_over_robots_keeps_farther_from_its_limit(evaluator):
    def residual(*line):
        goal, _ = goal_of(evaluator, WALKED, [used(WALKED, u) for u in line], speed=1e-9)
        return goal.residuals([SHAPE])[0].max()

    assert residual(0.94, 0.92, 0.90) < 1e-6
    assert residual(0.94, 0.70, 0.50) > 0.1


def test_limits_of_the_nominal_robot_count_by_its_own_run(evaluator):
    goal, _ = goal_of(evaluator, used(WALKED, 1.02), [used(WALKED, 0.5)] * 3, speed=1e-9)
    assert goal.residuals([SHAPE])[0].max() == pytest.approx(1.4)


def test_a_robot_that_falls_counts_as_slow_and_hides_no_limit(evaluator):
    goal, _ = goal_of(evaluator, WALKED, [fallen(15), used(WALKED, 1.1), used(WALKED, 0.7)], robots=1)
    (r,) = goal.residuals([SHAPE])
    assert np.count_nonzero(r == FALLEN) == 0
    assert r.max() > 1


def test_options_out_of_range_are_refused():
    with pytest.raises(InputError, match="probe"):
        RefineOptions(probe=0.0)
