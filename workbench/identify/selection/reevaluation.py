"""Re-evaluation of effects that were accepted early: their rivals are fitted as replacements, together with later effects.

A spring in one joint distorts the common error of all joints, so that a weak supply was preferred to one that sags; with a soft
knee, a longer leg was preferred to a wrongly zeroed joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.options import FIT
from workbench.identify.selection.best_subsets import fitted_beside
from workbench.identify.selection.candidate_fit import CandidateFit
from workbench.identify.selection.options import RECORD, REEVALUATION, SUBSETS
from workbench.identify.selection.record import SelectionStep, judged_by_all


def reevaluate(
    search: Search, current: Fit, rounds: Sequence[SelectionStep], takes: tuple[int, ...]
) -> tuple[Fit, list[SelectionStep]]:
    """The fit and its rounds, such effects replaced where a rival leaves less on these takes, beside all that came since; rivals'
    gains as they are there."""
    out = list(rounds)
    for n, r in enumerate(rounds):
        for t in r.accepted if any(later.accepted for later in rounds[n + 1:]) else ():
            if _weighable(search, t) and t.closed < RECORD.complete and t.candidate.key in current.sizes_by_key():
                current, out[n] = _reevaluate(search, current, out[n], t, takes)
    return current, out


def _reevaluate(
    search: Search, current: Fit, r: SelectionStep, t: CandidateFit, takes: tuple[int, ...]
) -> tuple[Fit, SelectionStep]:
    rivals = [o for o in r.trials if _weighable(search, o) and o.candidate.key not in current.sizes_by_key()
              and o.gain["choose"] > REEVALUATION.near * t.gain["choose"]][:REEVALUATION.most]
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
