"""What fixed-base takes say of numbers that floating-base takes identified."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.gap_linear import candidate
from workbench.identify.fitting.fit import Fit
from workbench.identify.selection.reconsider import checked_on_fixed_base

CEILING, FLOOR = candidate("torque_ceiling"), candidate("ground_friction")


class TwoWorlds:
    """A fixed-base take (0) and a walk (1): the residual of each by size of a torque ceiling; None: without a ceiling."""

    fixed_base, fitted, settled = (0,), (0, 1), None
    evaluator = SimpleNamespace(cost=lambda residuals, use: float(sum(r.sum() for r in residuals.values())))

    def __init__(self, held, walk, as_held_takes_tell):
        self.leaves, self.tells = (held, walk), as_held_takes_tell

    def floating_base(self, takes):
        return tuple(i for i in takes if i)

    def is_settled(self, c):
        return self.settled is not None and c.key in {e.key for e in self.settled.effects}

    def evaluate(self, sizes):
        size = next((float(x[0]) for c, x in sizes if c is CEILING), None)
        left = {i: np.array([[leaves(size)]]) for i, leaves in enumerate(self.leaves)}
        x = np.concatenate([np.empty(0), *(x for _, x in sizes)])
        return Fit(tuple(c for c, _ in sizes), x, np.eye(len(x)), {}, left)

    def resettle(self, current, *more):
        other = TwoWorlds(*self.leaves, self.tells)
        other.settled = self.evaluate([(c, np.array([self.tells])) for c in more])
        return other, self.evaluate([(c, np.array([self.tells]) if c in more else x) for c, x in current.sizes()])


def held(size):
    """Smooth, best at 1.15, and barely better there than without."""
    return 26400.0 if size is None else 26200.0 + 2e4 * (size - 1.15) ** 2


@pytest.mark.parametrize(("there", "size", "settled"), [(27500.0, 1.15, True), (35000.0, 1.42, False)],
                         ids=["walks hardly mind", "walks show less of it"])
def test_a_number_that_fixed_base_takes_contradict_is_theirs_where_walks_hardly_mind(there, size, settled):
    search = TwoWorlds(held, lambda x: {None: 49000.0, 1.42: 25600.0, 1.15: there}[x], 1.15)
    search, fit = checked_on_fixed_base(
        search, search.evaluate([(FLOOR, np.array([0.3])), (CEILING, np.array([1.42]))]), [FLOOR, CEILING]
    )
    assert fit.x.tolist() == [0.3, size]
    assert search.is_settled(CEILING) is settled
    assert not search.is_settled(FLOOR)


def test_what_fixed_base_takes_do_not_contradict_or_would_rather_not_have_stays():
    near = TwoWorlds(held, lambda x: {None: 49000.0, 1.2: 25600.0}[x], 1.15)
    assert checked_on_fixed_base(near, near.evaluate([(CEILING, np.array([1.2]))]), [CEILING])[1].x.tolist() == [1.2]
    never = TwoWorlds(lambda x: 26400.0 if x is None else 26800.0, lambda x: 49000.0 if x is None else 25600.0, 1.15)
    same, fit = checked_on_fixed_base(never, never.evaluate([(CEILING, np.array([1.42]))]), [CEILING])
    assert fit.x.tolist() == [1.42]
    assert same.settled is None
