"""Effects that others make idle go, once the others have gone where they must."""

import numpy as np
import pytest

from tests.gap_linear import COUNT, LinearSearch, candidate
from workbench.identify.selection import reconsider
from workbench.identify.selection.reconsider import without_idle

RNG = np.random.default_rng(3)
AHEAD, BELOW, INERTIA, CEILING = RNG.normal(size=(4, COUNT))
DOES = {"payload": [INERTIA, AHEAD, 0 * AHEAD, BELOW], "parallel_spring": [BELOW], "zero_offset": [AHEAD],
        "torque_ceiling": [CEILING]}
"""Response to each effect's parameters: a load acts like a spring and a zero offset together, and also slows the joint."""
FOUND = {"torque_ceiling": [2.0], "parallel_spring": [3.0], "payload": [1.0, 0.2, 0.0, 0.5], "zero_offset": [1.5]}


class Search(LinearSearch):
    """A step goes most of the way."""

    fixed_base = ()

    def refit(self, fit, takes, steps, free=None):
        end = self.run(self.refitting(fit, takes, steps))
        return self.evaluate(fit.sizes(fit.x + (0.9 if steps == 1 else 1.0) * (end.x - fit.x)))


@pytest.mark.parametrize(("against", "stay"), [(False, set(FOUND)), (True, {"torque_ceiling", "payload"})])
def test_a_load_takes_the_place_of_spring_and_zero_where_fixed_base_takes_contradict_these(monkeypatch, against, stay):
    search = Search(DOES, torque_ceiling=[2.0], payload=[1.0, 1.7, 0.0, 3.5])
    monkeypatch.setattr(reconsider, "contradicted_by_fixed_base", lambda *a: against)
    fit = search.evaluate([(candidate(name), np.array(x)) for name, x in FOUND.items()])
    kept = without_idle(search, fit)
    assert {c.name for c in kept.effects} == stay
    assert kept.cost["choose"] < 1e-6


def test_what_nothing_else_does_stays():
    hidden = {name: x for name, x in FOUND.items() if name != "payload"}
    search = Search(DOES, **hidden)
    fit = search.evaluate([(candidate(name), np.array(x)) for name, x in hidden.items()])
    assert without_idle(search, fit).effects == fit.effects
