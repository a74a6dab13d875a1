"""The search of a robot of several joints: of its joints in lockstep, and of effects that act on all of them at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from workbench.identify.evidence.fit import Fitted, evaluate
from workbench.identify.evidence.hypothesis import Hypothesis
from workbench.identify.evidence.linearise import linearise
from workbench.identify.evidence.options import NUMERICS, EvidenceOptions
from workbench.identify.evidence.robot_wide import Together, Whole
from workbench.identify.evidence.search import (
    Found,
    complete_search,
    continue_search,
    lockstep,
    recalibrate_nominal,
    search,
    with_best,
)
from workbench.identify.parameters import Candidate, Key
from workbench.types import Progress

if TYPE_CHECKING:
    from workbench.identify.evidence.rollouts import Rollouts


@dataclass(frozen=True)
class RobotFound:
    """State of the search: rollouts, the results by region, and all of them together. instead: the best alternative model [nats]
    by the effect of the whole robot that it has instead of ours; None: the joints alone. rivals: by a joint's effect, the
    best one of the whole robot that could replace it, and its advantage in log posterior [nats]."""

    rollouts: Rollouts
    found: tuple[Found, ...]
    together: Together
    instead: tuple[tuple[Candidate | None, float], ...] = ()
    rivals: Mapping[Key, tuple[Candidate, float]] = field(default_factory=dict)

    @property
    def sure(self) -> float:
        """Probability of the effects of the whole robot, against every alternative that was tried."""
        if not self.together.shared.effects:
            return 0.0
        others = [min(nats - self.together.log_posterior, 700.0) for _, nats in self.instead]
        return float(1.0 / (1.0 + np.exp(others).sum()))


def search_robot(rollouts: Rollouts, names: Sequence[Candidate], options: EvidenceOptions, report: Progress) -> RobotFound:
    """Searches joints and robot. names: effects that act on all joints at once. Such an effect goes first where it explains a
    good part of the gain of the best effect in each joint, and is then compared with the search without it; else it is searched
    for in addition to the joints' effects."""
    if not names:
        whole, found = search(rollouts, options, report)
        return RobotFound(whole, found, Whole(whole, (), options).start([f.best for f in found]))
    start, found = recalibrate_nominal(rollouts, options, report)
    first = _first(start, found, names, options, report)
    at = _to_the_end(*first, names, rollouts.step, options, report)
    if not at.together.shared.effects:
        return at
    if first[0].shared.effects:
        report("the same without effects of the whole robot", None)
        alone, alone_found = complete_search(start, found, rollouts.step, options, report, at.rollouts.horizon)
    else:
        alone, alone_found = continue_search(replace(at.rollouts, shared=start.shared), at.found, options, report)
    of_alone = Whole(alone, (), options)
    together = of_alone.fit(of_alone.start([f.best for f in alone_found]))
    return _choose_state(at, RobotFound(alone, alone_found, together), names, options)


def _first(rollouts: Rollouts, found: Sequence[Found], names: Sequence[Candidate], options: EvidenceOptions, report: Progress
           ) -> tuple[Rollouts, tuple[Found, ...]]:
    """The first fits, with an effect of the whole robot where that comes first."""
    report("effects of the whole robot", None)
    whole = Whole(rollouts, tuple(names), options)
    alone = whole.start([f.best for f in found])
    moves = lockstep(rollouts, {k: linearise(f.region, options, f.best) for k, f in enumerate(found)})
    by_joints = sum(max(0.0, moves[k][0].gain) if moves[k] else 0.0 for k in range(len(found)))
    added = whole.predict(alone)
    fit = whole.fit(added) if added is not None and added.log_posterior > alone.log_posterior else None
    if fit is None or fit.log_posterior <= alone.log_posterior + NUMERICS.first * by_joints:
        return rollouts, tuple(found)
    return _beside(rollouts, [replace(f, fits={}) for f in found], fit)


def _to_the_end(rollouts: Rollouts, found: Sequence[Found], names: Sequence[Candidate], step: float, options: EvidenceOptions,
                report: Progress) -> RobotFound:
    """Joints searched, and effects of the whole robot added as long as they pay."""
    rollouts, found = complete_search(rollouts, found, step, options, report)
    for _ in range(NUMERICS.rounds):
        report("effects of the whole robot", None)
        whole = Whole(rollouts, tuple(names), options)
        now = whole.fit(whole.start([f.best for f in found]))
        rollouts, found = _beside(rollouts, found, now)
        more = whole.predict(now)
        added = [whole.fit(more)] if more is not None and more.log_posterior > now.log_posterior else []
        swaps = _swaps(whole, found, now)
        best = max([now, *added, *(t for _, t in swaps)], key=lambda t: t.log_posterior)
        if best is now or len(best.shared.effects) > NUMERICS.rounds or rollouts.exhausted:
            rivals = {c.key: (t.shared.effects[-1], t.log_posterior - now.log_posterior) for c, t in swaps}
            return RobotFound(rollouts, tuple(found), now, rivals=rivals)
        rollouts, found = continue_search(*_beside(rollouts, found, best), options, report)
    whole = Whole(rollouts, tuple(names), options)
    return RobotFound(rollouts, tuple(found), whole.fit(whole.start([f.best for f in found])))


def _swaps(whole: Whole, found: Sequence[Found], now: Together) -> list[tuple[Candidate, Together]]:
    """Each joint's effect, compared with the best effect of the whole robot as its replacement: a tilted stand turns an arm's
    first joint in the same way as a wrongly mounted horn."""
    out = []
    for k, f in enumerate(found):
        for c in f.best.hypothesis.effects:
            bare = f.fits.get(f.best.hypothesis.without(lambda other, c=c: other is c).key)
            more = None if bare is None else whole.predict(whole.start([*now.fits[:k], bare, *now.fits[k + 1:]]))
            out += [] if more is None else [(c, whole.fit(more))]
    return out


def _beside(rollouts: Rollouts, found: Sequence[Found], at: Together) -> tuple[Rollouts, tuple[Found, ...]]:
    """State with shared effects and the fits of the regions."""
    states = tuple(replace(f, fits={**(f.fits if f.fits and fit.hypothesis.key == f.best.hypothesis.key else {}),
                                    fit.hypothesis.key: fit}) for f, fit in zip(found, at.fits))
    return with_best(replace(rollouts, shared=at.shared), states), states


def _choose_state(at: RobotFound, alone: RobotFound, names: Sequence[Candidate], options: EvidenceOptions) -> RobotFound:
    """The more probable state, and the other, both judged by the same correlation times: the shorter, since a poor model's are
    long."""
    taus = [min(a.region.likelihood.tau, b.region.likelihood.tau) for a, b in zip(at.found, alone.found)]

    def anew(of: Together, rollouts: Rollouts) -> Together:
        regions = tuple(r.with_correlation_time(tau) for r, tau in zip(rollouts.regions, taus))
        whole = Whole(replace(rollouts, regions=regions), tuple(names), options)
        fits: list[Fitted] = [evaluate(r, options, f.hypothesis, f.r, f.J) for r, f in zip(regions, of.fits)]
        return whole.evaluate(of.shared, fits, of.slopes)

    ours, theirs = anew(at.together, at.rollouts), anew(alone.together, alone.rollouts)
    whole = Whole(at.rollouts, tuple(names), options)
    others: list[tuple[Candidate | None, float]] = [(None, theirs.log_posterior)]
    for c in at.together.shared.effects:
        left: Hypothesis = at.together.shared.without(lambda other, c=c: other is c)
        fits = at.together.fits
        bare = whole.evaluate(left, fits, [np.zeros((len(f.r), len(left.theta))) for f in fits])
        instead = replace(whole, names=tuple(n for n in names if n.key != c.key)).predict(whole.fit(bare))
        if instead is not None:
            instead = whole.fit(instead)
            others.append((instead.shared.effects[-1], instead.log_posterior + ours.log_posterior - at.together.log_posterior))
    if theirs.log_posterior > ours.log_posterior:
        rival = (ours.shared.effects[-1], ours.log_posterior - theirs.log_posterior)
        return replace(alone, rivals=dict.fromkeys(_own(alone) - _own(at), rival))
    return replace(at, together=ours, instead=tuple(others))


def _own(of: RobotFound) -> set[Key]:
    """The joints' effects."""
    return {c.key for f in of.together.fits for c in f.hypothesis.effects}
