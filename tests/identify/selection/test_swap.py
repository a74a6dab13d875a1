"""One of several effects in a joint replaced by another: what lines around their fit predict."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap_linear import names, trial
from workbench.identify.fitting.fit import Fit
from workbench.identify.selection import swap
from workbench.identify.selection.best_subsets import worst_joint
from workbench.identify.selection.options import SUBSETS

RNG = np.random.default_rng(8)
FRICTION, PLAY, OTHER = RNG.normal(size=(3, 600))
DOES = {"viscous_friction": FRICTION, "backlash": PLAY, "dead_band": PLAY + 0.6 * OTHER, "servo_gain": OTHER}
"""Response of a joint to each effect, in sigma, at its typical size: a dead band looks like play from afar."""
RECORDED = 1.5 * FRICTION + 2.0 * DOES["dead_band"]


class LinearEvaluator:
    """A joint that answers in lines."""

    def residuals(self, questions):
        return [{0: self.left(q.model)} for q in questions]

    def left(self, sizes):
        return (RECORDED - sum(float(x[0]) * DOES[c.name] for c, x in sizes))[:, None]

    def vector(self, residuals, use, joint):
        return residuals[0][:, 0]

    def by_channel(self, residuals, use, joint):
        return np.array([np.sum(residuals[0] ** 2)]), np.array([600.0])


@pytest.fixture
def search(monkeypatch):
    monkeypatch.setattr(swap, "with_effects", lambda nominal, sizes: list(sizes))
    return SimpleNamespace(evaluator=LinearEvaluator(), nominal=None)


def fit_of(search, **sizes):
    """A fit of effects at these sizes."""
    chosen = [(trial(name).candidate, np.array([x])) for name, x in sizes.items()]
    left = search.evaluator.left(chosen)
    x = np.array(list(sizes.values()))
    return Fit(tuple(c for c, _ in chosen), x, np.eye(len(x)), {"choose": float(np.sum(left**2))}, {0: left})


def test_in_ones_place_another_is_offered_with_the_sizes_that_all_then_have(search):
    fit = fit_of(search, viscous_friction=1.2, backlash=2.0)
    asked = [trial(name) for name in DOES]
    sets = swap.exchanges(search, fit, asked, (0,), "knee", list(fit.effects))
    assert {"viscous_friction", "dead_band"} in names(sets)
    best = next(s for s in sets if {t.candidate.name for t in s} == {"viscous_friction", "dead_band"})
    assert {t.candidate.name: float(t.x[0]) for t in best} == pytest.approx({"viscous_friction": 1.5, "dead_band": 2.0}, rel=1e-3)
    assert not any(t.screened_out for t in best)
    assert all(len(s) == 2 for s in sets)


def test_only_what_was_found_together_is_replaced_and_by_nothing_that_is_there(search):
    fit = fit_of(search, viscous_friction=1.2, backlash=2.0)
    asked = [trial(name) for name in DOES]
    kept, *_ = fit.effects
    for chosen in swap.exchanges(search, fit, asked, (0,), "knee", list(fit.effects)[1:]):
        assert kept.key not in {t.candidate.key for t in chosen}
    assert swap.exchanges(search, fit, asked[:2], (0,), "knee", list(fit.effects)) == []
    assert swap.exchanges(search, fit, [trial("servo_gain", joint="hip")], (0,), "knee", list(fit.effects)) == []


@pytest.mark.parametrize(("right", "replaced"), [(0.5, True), (1e9, False)])
def test_sets_are_replaced_until_none_is_better_unless_the_first_leaves_no_more_than_a_right_model(search, monkeypatch, right,
                                                                                                 replaced):
    first = [trial("viscous_friction"), trial("backlash")]
    monkeypatch.setattr(swap, "several", lambda *a: [first])
    monkeypatch.setattr(swap, "SUBSETS", replace(SUBSETS, right=right))

    def fitted(search, current, sets, takes):
        fits = [fit_of(search, **{t.candidate.name: {"viscous_friction": 1.5, "dead_band": 2.0}.get(t.candidate.name, 1.0)
                                  for t in s}) for s in sets]
        return sorted(zip(fits, sets), key=lambda f: f[0].cost["choose"])

    monkeypatch.setattr(swap, "_fit_sets", fitted)
    (fit, chosen), *rest = swap.sets_at_worst_joint(search, None, [trial(n) for n in DOES], (0,), {"knee": 5.0})
    assert {t.candidate.name for t in chosen} == {"viscous_friction", "dead_band" if replaced else "backlash"}
    assert bool(rest) is replaced
    assert fit.cost["choose"] <= min((f.cost["choose"] for f, _ in rest), default=np.inf)


def test_the_joint_that_errs_most_is_one_and_not_the_body():
    assert worst_joint({"knee": 2.0, "hip": 3.0, "height": 9.0}) == "hip"
    assert worst_joint({"height": 9.0}) is None
