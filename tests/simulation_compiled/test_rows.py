"""The algebra of one robot's kernel, rows at once and limbs in turns, against the plain loops that lanes take."""

from __future__ import annotations

import numpy as np
import pytest

from workbench.robot import EffectSpec, RobotModel, puppy_model
from workbench.simulation.compiled.arrays import Array, Tree, work_for
from workbench.simulation.compiled.kernel import kernel
from workbench.simulation.compiled.rows import copy_rows, factor_rows, solve_rows, times_rows
from workbench.simulation.compiled.station import CompiledJob
from workbench.simulation.compiled.tree import copy_matrix, factor, solve_factored, times_matrix
from workbench.simulation.config import SimulationConfig
from workbench.simulation.job import Job


@kernel
def by_rows(tree: Tree, M: Array, H: Array, pivot: Array, x: Array, y: Array) -> None:
    copy_rows(tree, M, H)
    factor_rows(tree, H, pivot)
    times_rows(tree, M, x, y)
    solve_rows(tree, H, pivot, x)


@kernel
def by_numbers(tree: Tree, M: Array, H: Array, x: Array, y: Array) -> None:
    copy_matrix(tree, M, H)
    factor(tree.depth, tree.above, H)
    times_matrix(tree, M, x, y)
    solve_factored(tree.depth, tree.above, H, x)


def with_play(model: RobotModel) -> RobotModel:
    """A joint more behind each servo: paths longer than a stretch, and two legs that join at the waist."""
    return model.with_effects(tuple(EffectSpec("backlash", (j,), {"gap": 0.5}) for j in model.joints))


@pytest.mark.parametrize("base", ["fixed", "free"])
@pytest.mark.parametrize("model", [puppy_model(), with_play(puppy_model())], ids=["puppy", "with play"])
def test_rows_at_once_are_the_plain_loops_to_the_last_bit(model, base):
    """Searches take other ways after a difference in the last bit, and the base's order of sums is what keeps Drake's equal."""
    job = CompiledJob(Job(model, SimulationConfig(base=base, settle=1e-2), duration=1e-2, lead=0.0))
    tree, work = job.machine.tree, work_for(*job.machine)
    job.at_rest(work)
    n, random = len(tree.path), np.random.default_rng(0)
    for _ in range(20):
        M, other, pivot = work.M.copy(), work.H.copy(), np.zeros(n)
        M[np.arange(n), tree.depth] *= random.uniform(1.0, 3.0, n)
        x, y = random.normal(size=n), np.zeros(n)
        also_x, also_y = x.copy(), y.copy()
        by_rows(tree, M, work.H, pivot, x, y)
        by_numbers(tree, M, other, also_x, also_y)
        np.testing.assert_array_equal(x, also_x)
        np.testing.assert_array_equal(y, also_y)
        np.testing.assert_array_equal(pivot, other[np.arange(n), tree.depth])


def test_rows_solve_what_the_whole_matrix_solves():
    job = CompiledJob(Job(with_play(puppy_model()), SimulationConfig(settle=1e-2), duration=1e-2, lead=0.0))
    tree, work = job.machine.tree, work_for(*job.machine)
    job.at_rest(work)
    n = len(tree.path)
    whole = np.zeros((n, n))
    for k in range(n):
        way = tree.above[k, :tree.depth[k] + 1]
        whole[k, way] = whole[way, k] = work.M[k, :len(way)]
    x, y = np.random.default_rng(1).normal(size=n), np.zeros(n)
    expected = whole @ x, np.linalg.solve(whole, x)
    by_rows(tree, work.M, work.H, np.zeros(n), x, y)
    np.testing.assert_allclose(y, expected[0], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(x, expected[1], rtol=1e-9)
