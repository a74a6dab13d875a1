"""Accepted effects reconsidered: loose links rattle by chance, held takes contradict a number, later effects replace one."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from workbench.compare.channels import ACROSS
from workbench.effects.base import si_values
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search, contradicted_by_fixed_base, gain_between
from workbench.identify.options import FIT
from workbench.identify.parameters import Candidate, Key
from workbench.identify.problem import TakeEvidence
from workbench.identify.selection.acceptance import explained_at_the_end
from workbench.identify.selection.best_subsets import fitted_beside
from workbench.identify.selection.options import ACCEPTANCE, RECONSIDER, SUBSETS
from workbench.identify.selection.record import CandidateFit, SelectionStep, judged_by_all


def left_to_chance(search: Search, current: Fit, known: Collection[Key]) -> tuple[Search, Fit]:
    """The search in which loose links that are in the fit, and were not `known`, rock as they may, and the fit as it is then: the
    sigma of their off-axis channels includes their play.

    No model can predict for long at which end of the gap such a link lies. Two independently rattling links differ by a sixth of
    the square of their play, in the mean square, which is far beyond noise: without this, any effect that happens to shake the
    model's link at the right moment looks like the next cause, and hides a load on the body."""
    loose = {c.where[0]: si_values(c.effect, c.spec(x))[c.effect.free_play] for c, x in current.sizes()
             if c.key not in known and c.read_off and c.effect.free_play}
    if not loose:
        return search, current
    evaluator = search.evaluator.on([_wider(e, loose) for e in search.evaluator.evidence])
    search = Search(evaluator, search.nominal, search.settled)  # responses were looked at in other units
    there = search.evaluate(current.sizes())
    return search, replace(current, cost=there.cost, residuals=there.residuals)


def _wider(e: TakeEvidence, loose: dict[str, float]) -> TakeEvidence:
    """loose: play by joint [rad]."""
    chance = np.zeros(len(e.channels))
    for joint, play in loose.items():
        chance[[k for k, c in enumerate(e.channels) if c.startswith(joint + ACROSS)]] = play / np.sqrt(6.0)
    return replace(e, rough=np.sqrt(np.square(e.rough) + np.square(chance / e.sigma)))


def checked_on_fixed_base(search: Search, current: Fit, identified: Sequence[Candidate]) -> tuple[Search, Fit]:
    """The fit with such numbers of effects that floating-base takes have just identified as fixed-base takes identify them, and
    the search in which these are settled; as it was where floating-base takes then show less of them, or fixed-base takes want
    none at all. On walking data a fit may stop in a spurious minimum, where the fixed-base takes, in which the parameter is
    barely excited, contradict it smoothly."""
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


def reevaluate(
    search: Search, current: Fit, rounds: Sequence[SelectionStep], takes: tuple[int, ...]
) -> tuple[Fit, list[SelectionStep]]:
    """The fit and its rounds, with effects that were accepted early replaced where a rival leaves less on these takes, beside all
    that came since; rivals' gains as they are there. A spring in one joint distorts the common error of all joints, so that a
    weak supply was preferred to one that sags; with a soft knee, a longer leg was preferred to a wrongly zeroed joint."""
    out = list(rounds)
    for n, r in enumerate(rounds):
        for t in r.accepted if any(later.accepted for later in rounds[n + 1:]) else ():
            if _weighable(search, t) and t.closed < RECONSIDER.complete and t.candidate.key in current.sizes_by_key():
                current, out[n] = _reevaluate(search, current, out[n], t, takes)
    return current, out


def _reevaluate(
    search: Search, current: Fit, r: SelectionStep, t: CandidateFit, takes: tuple[int, ...]
) -> tuple[Fit, SelectionStep]:
    rivals = [o for o in r.trials if _weighable(search, o) and o.candidate.key not in current.sizes_by_key()
              and o.gain["choose"] > RECONSIDER.near * t.gain["choose"]][:RECONSIDER.most]
    if not rivals:
        return current, r
    rest = search.evaluate(current.sizes_without(t.candidate.key))
    fits = search.side_by_side([fitted_beside(search, rest, [o], takes, SUBSETS.most_steps) for o in rivals])

    def remaining(fit: Fit) -> dict[str, float]:
        return {use: search.evaluator.cost({i: fit.residuals[i] for i in takes}, use) for use in t.gain}

    was = remaining(current)
    anew = {o.candidate.key: replace(o, x=fit.sizes_by_key()[o.candidate.key],
                                     gain={use: t.gain[use] + was[use] - now for use, now in remaining(fit).items()})
            for o, fit in zip(rivals, fits)}
    known = [anew.get(o.candidate.key, o) for o in r.trials]
    best, taken = max(zip(fits, anew.values()), key=lambda f: f[1].gain["choose"] - FIT.least_gain * len(f[0].x))
    if taken.gain["choose"] - t.gain["choose"] < FIT.least_gain * (1 + len(best.x) - len(current.x)):
        best, taken = current, t
    return best, replace(r, trials=tuple(sorted(known, key=lambda o: -o.gain["choose"])),
                         accepted=tuple(taken if a is t else a for a in r.accepted))


def _weighable(search: Search, t: CandidateFit) -> bool:
    """Whether another effect may replace it: not for effects on how cameras see the robot."""
    return judged_by_all(search, t) and t.candidate.effect.layer != "measurement"


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
        if before - current.cost["choose"] < RECONSIDER.clearly * least:
            rest = search.refit(rest, search.fitted, 1, range(len(rest.effects)) if settled else None)
        if not settled and contradicted_by_fixed_base(search, current, rest):
            rest = search.refit(rest, search.fitted, SUBSETS.together_steps)
        if rest.cost["choose"] - current.cost["choose"] < least:
            current = rest
    return current
