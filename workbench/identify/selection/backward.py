"""Backward elimination: accepted effects that the others have made redundant are dropped."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search, contradicted_by_fixed_base
from workbench.identify.options import FIT
from workbench.identify.selection.acceptance import explained_at_the_end
from workbench.identify.selection.options import ACCEPTANCE, BACKWARD, SUBSETS
from workbench.identify.selection.record import SelectionStep


def without_part_answers(search: Search, current: Fit, rounds: Sequence[SelectionStep]) -> Fit:
    """Backward elimination, from the last effect to the first: drops those that left half of the excess error and that no later
    effect completed."""
    for r in reversed(rounds):
        for t in r.accepted:
            if explained_at_the_end(search, r, t, current) < ACCEPTANCE.last_closed:
                current = search.evaluate(current.sizes_without(t.candidate.key))
    return current


def without_idle(search: Search, current: Fit) -> Fit:
    """Backward: an effect that the others have made idle goes. The others may have far to go where fixed-base takes go better
    without it, as a knee that was not fitted soft enough leaves floating-base takes something for play to close."""
    for i in range(len(current.effects) - 1, -1, -1):
        if len(current.effects) < 2:
            break
        c, settled = current.effects[i], search.is_settled(current.effects[i])
        least = FIT.least_gain * max(1, c.size) * (ACCEPTANCE.all_closed if settled else 1.0)
        rest = search.evaluate(current.sizes_without(c.key))
        before = rest.cost["choose"]
        if before - current.cost["choose"] < BACKWARD.clearly * least:
            rest = search.refit(rest, search.fitted, 1, range(len(rest.effects)) if settled else None)
        if not settled and contradicted_by_fixed_base(search, current, rest):
            rest = search.refit(rest, search.fitted, SUBSETS.together_steps)
        if rest.cost["choose"] - current.cost["choose"] < least:
            current = rest
    return current
