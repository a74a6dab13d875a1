"""Several effects in one joint: which sets responses predict."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap_linear import names, trial
from tests.identify.small import search_on
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.lockstep import together
from workbench.identify.options import FIT
from workbench.identify.selection.best_subsets import Response, best_sets, restart_fit, several, variants


def seen(name, signature, size=1.0):
    return Response(trial(name), np.array(signature, dtype=float)[:, None], np.array([[size]]))


def test_two_are_named_where_both_together_explain_what_neither_does_though_a_third_explains_most_alone():
    rng = np.random.default_rng(3)
    friction, play = rng.normal(size=(2, 400))
    between = friction + play + rng.normal(size=400)
    r0 = -(2.0 * friction + 2.2 * play) + 0.01 * rng.normal(size=400)
    pool = [seen("viscous_friction", between), seen("coulomb_friction", friction, 4.0), seen("backlash", play)]
    both, *_ = best_sets(pool, r0)
    assert {t.candidate.name: float(t.x[0]) for t in both} == pytest.approx(
        {"coulomb_friction": 8.0, "backlash": 2.2}, rel=0.02)  # in the sizes at which they were looked at
    assert not any(t.screened_out for t in both)


def test_one_more_that_does_not_halve_what_is_left_is_not_asked_for_nor_one_that_would_have_to_be_less_than_nothing():
    rng = np.random.default_rng(4)
    friction, play, other = rng.normal(size=(3, 400))
    alone = -2.0 * friction + rng.normal(size=400)
    assert best_sets([seen("coulomb_friction", friction), seen("backlash", play), seen("dead_band", other)], alone) == []
    less = -2.0 * friction + 2.0 * play
    assert names(best_sets([seen("coulomb_friction", friction), seen("backlash", play)], less)) == []


def test_an_effect_seen_at_several_sizes_takes_one_place_and_its_shape_is_kept():
    sticking = trial("stribeck_friction")
    points = [np.array([1.0, 0.0]), np.array([1.0, 2.0])]
    rng = np.random.default_rng(5)
    slow, fast, play = rng.normal(size=(3, 300))
    pool = [*variants(sticking, points, [slow, fast]), seen("backlash", play)]
    assert len(pool) == 3
    (both,) = best_sets(pool, -(1.5 * fast + play))
    assert next(t.x for t in both if t.candidate.name == "stribeck_friction") == pytest.approx([1.5, 2.0])


def test_a_walk_and_what_one_explains_are_left_to_single_effects():
    search = search_on("free")
    assert several(search, None, [trial("backlash")], (0,), "knee") == []
    held = search_on("fixed")
    assert several(held, None, [trial("backlash", closed=0.95)], (0,), "knee") == []


def test_pairs_that_lines_predict_about_as_well_are_all_fitted():
    """A slow clock and a timing drift have nearly the same response."""
    rng = np.random.default_rng(6)
    sag, late, noise = rng.normal(size=(3, 400))
    pool = [seen("supply_sag", sag), seen("clock_rate", late), seen("timing_drift", late + 0.1 * noise)]
    sets = names(best_sets(pool, -(2.0 * sag + late) + 0.2 * rng.normal(size=400)))
    assert sets == [{"supply_sag", "clock_rate"}, {"supply_sag", "timing_drift"}]


@pytest.mark.parametrize(("elsewhere", "again"), [(40.0, True), (60.0, False)])
def test_a_shaped_effect_is_fitted_from_elsewhere_too_and_goes_there_only_for_far_less(elsewhere, again):
    """Stribeck friction's speed and torque share a curved valley, and a fit ends off its floor."""
    friction, play = (trial(n).candidate for n in ("stribeck_friction", "backlash"))
    begun = []

    def fit_at(sizes, cost):
        x = np.concatenate([x for _, x in sizes])
        return Fit(tuple(c for c, _ in sizes), x, np.eye(len(x)), {"choose": cost}, {})

    def ended(start, takes, steps):
        begun.append(start)
        return fit_at(start.sizes(), elsewhere if start.x[0] > 1.0 and start.x[1] < 0.5 else 1000.0)

    def asks_nothing(answer):
        yield from ()
        return answer

    search = SimpleNamespace(side_by_side=lambda parts: list(together(dict(enumerate(parts)), lambda wanted: []).values()),
                             evaluating=lambda *starts: asks_nothing([fit_at(s, 1e4) for s in starts]),
                             refitting=lambda *a: asks_nothing(ended(*a)), refit=ended)
    here = fit_at([(friction, np.array([1.0, 0.5])), (play, np.array([2.0]))], 100.0 + FIT.least_gain * 3)
    there = restart_fit(search, here, (0,), 9)
    assert (there is not here) is again
    assert {tuple(np.sign(f.x[:2] - here.x[:2])) for f in begun} == {(-1, -1), (-1, 1), (1, -1), (1, 1)}
    assert all(f.x[2] == 2.0 for f in begun)
    alone = fit_at([(play, np.array([2.0]))], 100.0)
    assert restart_fit(search, alone, (0,), 9) is alone
