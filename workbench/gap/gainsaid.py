"""What walks told and held takes gainsay: a walk answers small differences with large ones, so that a fit may end where chance
leaves little, beside a motor's end that held takes, which it barely shows in, tell smoothly."""

from __future__ import annotations

from collections.abc import Sequence

from workbench.gap.candidate import Candidate
from workbench.gap.company import NEARLY_ALL
from workbench.gap.search import AGAINST, Fit, Search


def heard(search: Search, current: Fit, told: Sequence[Candidate]) -> Fit:
    """The fit with such numbers of effects that walks have just told as held takes tell them, which settles these; as it was
    where walks then show less of them, or held takes want none at all."""
    if not search.held:
        return current
    for c in told:
        if c.where and c.size and not c.read_off and c.effect.layer != "ground" and not search.is_settled(c):
            current = _heard(search, current, c)
    return current


def _heard(search: Search, current: Fit, c: Candidate) -> Fit:
    held, walks = search.held, search.grounded(search.fitted)
    without = search.evaluated(current.sizes_without(c.key))
    if _gain(search, current, without, held) < AGAINST:
        return current
    settled = search.settled
    fit = search.resettled(current, c)
    if _gain(search, without, fit, held) > 0 and \
            _gain(search, without, fit, walks) > NEARLY_ALL * _gain(search, without, current, walks):
        return fit
    search.settled = settled
    return current


def _gain(search: Search, before: Fit, after: Fit, takes: tuple[int, ...]) -> float:
    """Of chi squared on what is fitted of some takes."""
    was, now = (search.jury.cost({i: fit.residuals[i] for i in takes}, "fit") for fit in (before, after))
    return was - now
