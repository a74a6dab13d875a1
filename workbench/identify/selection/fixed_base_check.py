"""Consistency with fixed-base data: on walking data a fit may stop in a spurious minimum, where the fixed-base takes, in which
the parameter is barely excited, contradict it smoothly."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search, contradicted_by_fixed_base, gain_between
from workbench.identify.parameters import Candidate
from workbench.identify.selection.options import SUBSETS


def checked_on_fixed_base(search: Search, current: Fit, identified: Sequence[Candidate]) -> tuple[Search, Fit]:
    """The fit with such numbers of effects that floating-base takes have just identified as fixed-base takes identify them, and
    the search in which these are settled; as it was where floating-base takes then show less of them, or fixed-base takes want
    none at all."""
    if not search.fixed_base:
        return search, current
    for c in identified:
        if c.where and c.size and not c.read_off and c.effect.layer != "ground" and not search.is_settled(c):
            search, current = _check(search, current, c)
    return search, current


def _check(search: Search, current: Fit, c: Candidate) -> tuple[Search, Fit]:
    fixed, floating = search.fixed_base, search.floating_base(search.fitted)
    without = search.evaluate(current.sizes_without(c.key))
    if not contradicted_by_fixed_base(search, current, without):
        return search, current
    settled, fit = search.resettle(current, c)
    walking = [gain_between(search.evaluator, without, there, floating, "fit") for there in (fit, current)]
    if gain_between(search.evaluator, without, fit, fixed, "fit") > 0 and walking[0] > SUBSETS.nearly_all * walking[1]:
        return settled, fit
    return search, current
