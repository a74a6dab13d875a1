"""Whether a gait comes back to its cycle."""

from dataclasses import replace

import numpy as np
import pytest

from tests.gait.test_measure import take_of
from workbench.gait.cycles import cycles_of, scatter_of
from workbench.gait.limit_cycle import LimitCycle, Return, came_back
from workbench.gait.limits import GaitLimits, return_margin

OWN = np.array([[0.05, 0.0, 0.3], *[[0.3, 0.0, 0.01], [0.31, 0.0, -0.01]] * 4])
"""Forward and sideways speed and turn of each cycle of a gait from neutral, that scatters a little."""
UPRIGHT = take_of()


def after(*first: list[float]) -> np.ndarray:
    """These cycles, and then the gait's own."""
    return np.array([*first, *[[0.305, 0.0, 0.0]] * (10 - len(first))])


def test_cycles_of_a_glide_on_a_circle() -> None:
    cycles = cycles_of(take_of(0.2, 0.5, seconds=4.0), 1.0, 0.5, end=3.0)
    assert cycles == pytest.approx(np.tile([0.2, 0.0, 0.25], (4, 1)), abs=2e-3)  # a chord is a little shorter than its arc
    assert scatter_of(cycles).heading == pytest.approx(0.0, abs=1e-9)
    rough = scatter_of(np.array([[0.2, 0, 0.1], [0.3, 0, -0.1]]))
    assert (rough.speed, rough.heading) == pytest.approx((0.05, 0.1))


def test_the_last_strange_cycle_decides() -> None:
    assert came_back("push", UPRIGHT, after(), OWN) == Return("push", 0)
    assert came_back("push", UPRIGHT, after([0.3, 0.1, 0.0]), OWN).cycles == 1
    assert came_back("push", UPRIGHT, after([0.3, 0, 0], [0.3, 0, 0], [0.3, 0, 0.2]), OWN).cycles == 3


def test_another_way_to_walk_is_no_return() -> None:
    """A pace that runs at 0.31 m/s from its start, and at 0.25 for ever after a push, has two limit cycles."""
    other = np.tile([0.25, 0.0, 0.0], (10, 1))
    told = came_back("push", UPRIGHT, other, OWN)
    assert told.cycles is None
    cycle = LimitCycle(scatter_of(OWN), (Return("from neutral", 1), told), 10)
    margin = return_margin(cycle, GaitLimits())
    assert margin.where == "push"
    assert margin.use > 1
    assert return_margin(replace(cycle, returns=(Return("from neutral", 1), Return("push", 4))), GaitLimits()).use == 0.5


def test_too_late_to_be_sure_is_no_return() -> None:
    assert came_back("push", UPRIGHT, np.vstack([after()[:8], [[0.1, 0, 0]], after()[:2]]), OWN).cycles is None


def test_a_robot_that_lies_down_has_not_come_back() -> None:
    lying = take_of(tilt=np.radians(80))
    assert came_back("push", lying, after(), OWN) == Return("push", None, fell=True)
