"""Log odds of models from differences of chi squared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search, gain_between
from workbench.identify.options import FIT
from workbench.identify.parameters import Candidate
from workbench.identify.selection.options import ODDS
from workbench.identify.selection.record import CandidateFit


def is_equivalent(search: Search, fit: Fit, i: int, rival: Fit) -> bool:
    """Whether a rival moves the robot as effect i does, and fixed-base takes do not tell which it is."""
    if rival.effects[-1].name not in fit.effects[i].effect.equivalent_to:
        return False
    return -_better(search, fit, rival, search.fixed_base) < ODDS.better * misfit(search, fit)


def is_by_floating_base(search: Search, c: Candidate, taken: CandidateFit) -> bool:
    """Whether floating-base takes identify an effect."""
    return taken.joint is None and search.evaluator.any_floating(search.fitted) and not search.is_settled(c)


def dispersion(search: Search, fit: Fit, c: Candidate, taken: CandidateFit) -> float:
    """What leads of an effect's rivals are divided by when they become probabilities."""
    if is_by_floating_base(search, c, taken):
        return max(FIT.overdispersion_free, ODDS.rough * taken.gain["choose"]) * misfit(search, fit)
    return ODDS.temper * misfit(search, fit, taken.joint)


def misfit(search: Search, fit: Fit, joint: str | None = None) -> float:
    """Cost of a fit on the choosing stretches relative to a correct model, at least 1: the factor by which chi squared
    differences are larger than noise alone would make them. joint: one that was judged alone on a fixed base, and so is
    independent of errors elsewhere."""
    if joint is None:
        return max(1.0, fit.cost["choose"] / max(1.0, search.evaluator.expected_cost(search.fitted, "choose")))
    left, expected = search.evaluator.by_channel({i: fit.residuals[i] for i in search.fixed_base}, "choose", joint)
    return max(1.0, float(left.sum()) / max(1.0, float(expected.sum())))


def chi_squared_lead(search: Search, fit: Fit, rival: Fit, taken: CandidateFit) -> float:
    """Improvement in chi squared by a rival that replaces an effect, including the price of its parameters."""
    price = max(ODDS.number, ODDS.number_share * taken.gain["choose"])
    own = [c.key for c in rival.effects]
    (replaced,) = (i for i, c in enumerate(fit.effects) if c.key not in own)
    fewer = numbers_identified(fit, replaced) - numbers_identified(rival, len(own) - 1)
    return _ahead(search, fit, rival, replaced) + price * fewer


def _ahead(search: Search, fit: Fit, rival: Fit, replaced: int) -> float:
    """How far the finding is ahead, whatever numbers cost."""
    return better_on_fixed_base(search, fit, rival) if search.is_settled(fit.effects[replaced]) else better_by_both(fit, rival)


def is_outpriced(search: Search, fit: Fit, i: int, rival: Fit) -> bool:
    """Whether only the price of more numbers keeps a rival from effect i's place: a load that swings little is nearly a spring.
    Not one that is effect i with something added."""
    more = numbers_identified(rival, len(rival.effects) - 1) > numbers_identified(fit, i)
    return more and rival.effects[-1].effect.reduces_to != fit.effects[i].name and _ahead(search, fit, rival, i) > 0


def better_by_both(fit: Fit, rival: Fit) -> float:
    """Improvement by a rival of an effect that all takes identify, in chi squared on the choosing stretches: twice as many
    stretches are fitted, each with the same weight; the price of the parameters accounts for overfitting."""
    return by_both({use: fit.cost[use] - rival.cost[use] for use in ("choose", "fit")})


def by_both(of: Mapping[str, float]) -> float:
    """Chi squared of the fitted and the choosing stretches together, scaled to the length of the latter."""
    return (of["choose"] + of["fit"] / 2) / 2


def better_on_fixed_base(search: Search, fit: Fit, rival: Fit) -> float:
    """Improvement by a rival of an effect that fixed-base takes identified: these takes dominate, and floating-base takes add at
    most `most_from_floating`."""
    floating = _better(search, fit, rival, search.floating_base(search.fitted)) * ODDS.temper / FIT.overdispersion_free
    most = ODDS.most_from_floating
    return _better(search, fit, rival, search.fixed_base) + float(np.clip(floating, -most, most))


def _better(search: Search, fit: Fit, rival: Fit, takes: Sequence[int]) -> float:
    """How much less chi squared a rival leaves on these takes."""
    return gain_between(search.evaluator, fit, rival, takes, "choose")


def numbers_identified(fit: Fit, i: int) -> int:
    """Numbers of an effect that the data identify: where along its axis a joint carries a mass makes no name better. All of one
    that was too far behind to be fitted."""
    identified = int(np.count_nonzero(np.isfinite(np.diag(fit.covariance)[fit.slices()[i]])))
    return identified or fit.effects[i].size
