"""A weak supply that was taken for one that sags, while a spring was still missing."""

import numpy as np
import pytest

from tests.gap_linear import COUNT, LinearSearch, candidate
from workbench.identify.selection.reconsider import reevaluate
from workbench.identify.selection.record import CandidateFit, SelectionStep

SAGS, SPRING, WEAK, FADES = np.random.default_rng(5).normal(size=(4, COUNT))
DOES = {"supply_voltage": [0.8 * SAGS + 0.5 * SPRING + 0.3 * WEAK], "supply_sag": [SAGS], "thermal_fade": [SAGS + 0.5 * FADES],
        "parallel_spring": [SPRING]}
"""The response to a weak supply overlaps with those to a sagging supply and to a spring."""


def explained(search, *names):
    """These effects fitted together."""
    start = search.evaluate([(c, np.ones(c.size)) for c in map(candidate, names)])
    return search.run(search.refitting(start, (0,), 1))


def tried(search, name, closed=0.4):
    """An effect fitted alone."""
    fit, nominal = explained(search, name), search.evaluate([])
    return CandidateFit(fit.effects[0], fit.x, {use: nominal.cost[use] - fit.cost[use] for use in fit.cost}, None, closed=closed)


def rounds_of(search, closed=0.4):
    """The weak supply taken first, a spring then."""
    weak, others = tried(search, "supply_voltage", closed), [tried(search, n) for n in ("supply_sag", "thermal_fade")]
    spring = tried(search, "parallel_spring")
    return [SelectionStep(search.evaluate([]), (weak, *others), (weak,)),
            SelectionStep(explained(search, "supply_voltage"), (spring,), (spring,))]


def test_a_rival_that_leaves_less_beside_the_spring_takes_the_place_and_all_gains_are_told_anew():
    search = LinearSearch(DOES, supply_sag=(1.4,), parallel_spring=(1.5,))
    fit, (first, second) = reevaluate(search, explained(search, "supply_voltage", "parallel_spring"), rounds_of(search), (0,))
    assert {c.name: x[0] for c, x in fit.sizes()} == pytest.approx({"supply_sag": 1.4, "parallel_spring": 1.5})
    assert [t.candidate.name for t in first.accepted] == ["supply_sag"]
    assert first.trials[0] is first.accepted[0]
    gains = {t.candidate.name: t.gain["choose"] for t in first.trials}
    assert gains["supply_sag"] > gains["thermal_fade"]
    assert [t.candidate.name for t in second.accepted] == ["parallel_spring"]


def test_what_is_right_stays_and_what_closed_nearly_all_or_came_last_is_not_weighed():
    search = LinearSearch(DOES, supply_voltage=(1.4,), parallel_spring=(1.5,))
    fit = explained(search, "supply_voltage", "parallel_spring")
    now, rounds = reevaluate(search, fit, rounds_of(search), (0,))
    assert now is fit
    assert [t.candidate.name for t in rounds[0].accepted] == ["supply_voltage"]
    for known in (rounds_of(search, closed=0.98), rounds_of(search)[:1]):
        assert reevaluate(search, fit, known, (0,)) == (fit, known)
