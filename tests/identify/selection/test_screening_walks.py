"""Screening on walks: takes left to chance, sizes to look at, and slopes that contact does not drown."""

from types import SimpleNamespace

import numpy as np
import pytest

from workbench.effects.registry import known_effects
from workbench.identify.fitting.levenberg_marquardt import fit_blocks
from workbench.identify.fitting.lockstep import together
from workbench.identify.fitting.responses import scan, scan_sizes
from workbench.identify.options import FIT, PROBLEM
from workbench.identify.parameters import Candidate
from workbench.identify.selection.screening import CandidateEvaluation, Race


def test_where_one_walk_is_left_to_chance_another_says_where_to_begin():
    """Take 0 correlates with the floor's tilt; take 1 was disturbed by something else."""
    rng = np.random.default_rng(1)
    line, truth = rng.normal(size=(2, 60)), np.array([1.5, -0.5])
    calm, wild = -truth @ line, 50 * rng.normal(size=60)
    probes = [np.array(p, dtype=float) for p in ([2, 0], [0, 2], [-2, 0], [0, -2], [2, 2], [2, -2], [-2, 2], [-2, -2])]
    responses = [[np.concatenate([p @ line, 30 * rng.normal(size=60)])] for p in probes]
    power = {0: float(calm @ calm), 1: float(wild @ wild)}

    def calmest(explained, least=0.0):
        trying = CandidateEvaluation.__new__(CandidateEvaluation)
        trying.evaluator = SimpleNamespace(expected_cost=lambda takes, use: 60.0,
                                      stretches=lambda takes: np.repeat([0, PROBLEM.most_stretches], 60))
        trying.group, trying.race = [Candidate.of(known_effects()["ground_tilt"], (), (0.0, 0.0))], Race(least=least)
        trying.takes, trying.power, trying.r0 = (0, 1), power, [np.concatenate([calm, wild])]
        return trying._calmest(probes, responses, explained)

    take, x = calmest(0.0)
    assert take == 0
    assert x == pytest.approx(truth, abs=1e-3)
    assert calmest(0.9 * sum(power.values())) is None  # all are explained
    assert calmest(0.0, least=1e6) is None  # it shows too little


def test_one_number_looks_far_where_slopes_are_noise():
    """Where a foot grips or slips, a small step raises the cost and a large one lowers it."""
    def left(x: list[float]) -> np.ndarray:
        return np.array([abs(x[0] - 1.6) + (0.5 if 1.02 < x[0] < 1.2 else 0.0)])

    fit = fit_blocks([np.array([1.0])], [left([1.0])], [(np.array([0.0]), np.array([9.0]))], 4, 0.08)
    (solved,) = together({0: fit}, lambda wanted: [[left(list(p)) for p in point] for _, point in wanted])[0]
    assert solved.x[0] == pytest.approx(1.6, abs=0.05)


def test_one_number_looks_far_before_it_settles_on_a_little():
    """A move that wins a thousandth is no end where slopes are noise."""
    def left(x: list[float]) -> np.ndarray:
        rough = 1.0 if x[0] == 1.0 else 0.9995 if x[0] < 1.0 else 3.0
        return np.array([rough if abs(x[0] - 1.0) < 0.12 else abs(x[0] - 1.4) + 0.1])

    fit = fit_blocks([np.array([1.0])], [left([1.0])], [(np.array([0.0]), np.array([9.0]))], 4, 0.08)
    (solved,) = together({0: fit}, lambda wanted: [[left(list(p)) for p in point] for _, point in wanted])[0]
    assert solved.x[0] == pytest.approx(1.4, abs=0.05)


def test_slopes_of_a_small_number_come_of_moves_that_contact_does_not_drown():
    """A walk's residual responds to steps of a tenth with noise as large as the parameter's own response."""
    def left(x: np.ndarray) -> np.ndarray:
        noise = 0.3 * np.sin(40.0 * x[1])
        return np.array([x[0] - 10.0, 0.2 * (x[1] - 6.0) + noise, 3.0])

    def ends(magnitudes: np.ndarray | None) -> np.ndarray:
        start = np.array([9.0, 0.05])
        fit = fit_blocks(
            [start], [left(start)], [(np.full(2, -99.0), np.full(2, 99.0))], 4, FIT.stride_free, magnitudes=magnitudes
        )
        (solved,) = together({0: fit}, lambda wanted: [[left(p) for p in point] for _, point in wanted])[0]
        return solved.x

    assert ends(np.array([9.0, 9.0])) == pytest.approx([10.0, 6.0], abs=1.5)
    assert abs(ends(None)[1] - 6.0) > 1.5


@pytest.mark.parametrize(("name", "walking", "sizes"), [
    ("torque_ceiling", False, [1.0, 2.0, 4.0]), ("viscous_friction", False, [1.0, 4.0]), ("torque_ceiling", True, [1.0])])
def test_what_begins_at_some_load_is_looked_at_between(name, walking, sizes):
    effect = known_effects()[name]
    c = Candidate.of(effect, ("two",), (np.inf if name == "torque_ceiling" else 0.0,))
    assert [float(x[0]) for x in scan(c, FIT.scanned[:1] if walking else FIT.scanned, walking)] == sizes


@pytest.mark.parametrize(("name", "walking", "no_fixed_base", "sizes"), [
    ("coulomb_friction", False, False, FIT.scanned), ("coulomb_friction", True, False, FIT.scanned[:1]),
    ("coulomb_friction", True, True, FIT.scanned), ("ground_friction", True, True, FIT.scanned_ground),
    ("load_friction", True, False, FIT.scanned)])
def test_where_walks_are_all_that_tells_joints_are_looked_at_far_too(name, walking, no_fixed_base, sizes):
    """Of a hip's friction six times the typical one nothing was predicted at once its size, and more of a wrong name; a stand
    bounds no friction that grows with load."""
    effect = known_effects()[name]
    where = ("one",) if effect.places == ("joint",) else ()
    assert scan_sizes(Candidate.of(effect, where, (0.6,)), walking, no_fixed_base) == sizes
