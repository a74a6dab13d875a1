"""The stopping criterion and the acceptance test of the forward selection."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workbench.compare.channels import joint_of
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.options import FIT, PROBLEM
from workbench.identify.parameters import Candidate
from workbench.identify.problem import TakeEvidence, channel_gaps
from workbench.identify.selection.options import ACCEPTANCE, SCHEDULING, SUBSETS
from workbench.identify.selection.record import CandidateFit, SelectionStep, accepted_effects, before_rough
from workbench.identify.selection.scheduling import standing_out
from workbench.types import Array


def remaining(search: Search, current: Fit, before: Fit, takes: tuple[int, ...], share: float = ACCEPTANCE.least_share
               ) -> dict[str, float]:
    """Channels with a gap that is not just the remainder of a larger one before, `share` of it where the base is fixed."""
    evidence = search.evaluator.evidence
    out: dict[str, float] = {}
    for i in takes:
        was, now = channel_gaps(evidence[i], before.residuals[i]), channel_gaps(evidence[i], current.residuals[i])
        allowed = share if i in search.fixed_base else ACCEPTANCE.rough_share
        least = dict(zip(evidence[i].channels, _may_err(search, before, current, i, allowed)))
        out |= {c: max(s, out.get(c, 0.0)) for c, s in now.items() if s**2 - 1 > least[c] * (was.get(c, 0.0)**2 - 1)}
    return out


def _may_err(search: Search, before: Fit, now: Fit, take: int, share: float) -> Array:
    """The allowance of each channel of a take for errors of the accepted effects: a share of their gain from `before` to
    `now`."""
    e = search.evaluator.evidence[take]
    shares = np.full(len(e.channels), share)
    if not search.evaluator.any_floating((take,)):
        was, left = (_of_joints(e, fit.residuals[take]) for fit in (before, now))
        parts = sorted((left[j] / was[j], j) for j in e.joints if was[j] > PROBLEM.gap_ratio**2 - 1)
        given = {c.joint for c in now.effects}
        if len(parts) > 1 and parts[-1][0] > SCHEDULING.stands_out * parts[-2][0] and parts[-1][1] not in given:
            shares[e.columns(parts[-1][1])] *= ACCEPTANCE.alone
    return shares


def _of_joints(e: TakeEvidence, residual: Array) -> dict[str, float]:
    """Chi squared beyond noise, by frame, in each joint's channels."""
    beyond = np.nan_to_num(np.maximum(np.nanmean(np.square(residual[e.moving]), axis=0) - 1.0, 0.0))
    return {j: float(np.sum(beyond[e.columns(j)])) for j in e.joints}


def least_closed(search: Search, nominal: Fit, current: Fit) -> float:
    """Share of the excess error that an effect on the ground must remove in addition to those identified by fixed-base takes.
    Higher if a joint with an accepted effect still has a gap on the fixed base, since its true cause is then not in the
    vocabulary and biases all other effects."""
    given = {c.joint for c in current.effects}
    part = any(joint_of(c) in given for c in remaining(search, current, nominal, search.fixed_base, ACCEPTANCE.rough_share))
    return ACCEPTANCE.last_closed if part else ACCEPTANCE.least_closed


def too_little_left(search: Search, current: Fit, takes: tuple[int, ...], rounds: Sequence[SelectionStep], everywhere: bool = True
                    ) -> bool:
    """Whether all that is beyond noise would not be enough for one more effect: on the ground beside those of the whole robot
    that floating-base takes identified, and beyond what others, as all on a fixed base, may err by in each channel. everywhere:
    of floating-base takes, not in channels with a gap alone."""
    evaluator, left = search.evaluator, 0.0
    floating = evaluator.any_floating(takes)
    before, share = current if floating else before_rough(rounds, current), ACCEPTANCE.least_share
    settled = _settling(search, rounds)
    if floating and search.settled is not None and settled:
        before, share = settled[0].before, ACCEPTANCE.rough_share
    for i in takes:
        if channel_gaps(evaluator.evidence[i], current.residuals[i]):
            was, now = {i: before.residuals[i]}, {i: current.residuals[i]}
            may_err = _may_err(search, before, current, i, share)
            left += sum(evaluator.beyond(now, use, was, may_err, everywhere) for use in ("fit", "choose")) / 3  # a third chooses
    if not floating:
        return left < ACCEPTANCE.all_closed * FIT.least_gain
    brought = sum(t.gain["choose"] for t in accepted_effects(rounds) if t.joint is None and not search.is_settled(t.candidate))
    return left < max(ACCEPTANCE.least_walking, ACCEPTANCE.left_share * brought)


def _settling(search: Search, rounds: Sequence[SelectionStep]) -> list[SelectionStep]:
    """The rounds that accepted an effect identified by fixed-base takes."""
    return [r for r in rounds if any(search.is_settled(t.candidate) for t in accepted_effects([r]))]


def is_acceptable(search: Search, t: CandidateFit, takes: Sequence[int], rounds: Sequence[SelectionStep], current: Fit) -> bool:
    """Whether an effect that was fitted beside `current` brings enough."""
    if t.screened_out:
        return False
    floating = search.evaluator.any_floating(takes)
    least = ACCEPTANCE.least_walking if t.joint is None and floating else FIT.least_gain * max(1, t.candidate.size)
    if t.joint is not None and t.closed > SUBSETS.nearly_all:
        least *= ACCEPTANCE.all_closed
    gain = min(t.gain["choose"], t.gain["fit"] / 2)  # twice as many stretches are fitted
    if not floating:
        return min(gain, _beyond_error(search, t, takes, before_rough(rounds, current), current, ACCEPTANCE.least_share)) > least
    floating_terms = [(r, a) for r in rounds for a in accepted_effects([r])
              if (t.joint is None or a.joint in (None, t.joint)) and not search.is_settled(a.candidate)]
    brought = sum(a.gain["choose"] for _, a in floating_terms)
    settled = _settling(search, rounds)
    if search.settled is not None and settled:
        gain = min(gain, _beyond_error(search, t, takes, settled[0].before, search.settled, ACCEPTANCE.rough_share))
    if floating_terms and gain <= ACCEPTANCE.walking_share * brought:  # which may have been in other channels
        gain = min(gain, _beyond_error(search, t, takes, floating_terms[0][0].before, current, ACCEPTANCE.walking_share))
    return gain > least


def _beyond_error(search: Search, t: CandidateFit, takes: Sequence[int], before: Fit, now: Fit, share: float) -> float:
    """An effect's gain less the allowance for errors of the effects accepted from `before` to `now`, a share of their gain
    channel by channel: a strong effect in one joint must not hide one that moves all others, nor the reverse."""
    here = search.telling([t.candidate], tuple(takes))
    was, left = (search.evaluator.by_channel({i: fit.residuals[i] for i in here}, "choose", t.joint)[0] for fit in (before, now))
    evidence = search.evaluator.evidence
    shares = np.concatenate([_may_err(search, before, now, i, share)[evidence[i].columns(t.joint)] for i in sorted(here)])
    may_err = shares * np.maximum(was - left, 0.0)
    return float(np.sum(np.where(t.by_channel > 0, np.maximum(t.by_channel - may_err, 0.0), t.by_channel)))


def explained_at_the_end(search: Search, r: SelectionStep, t: CandidateFit, now: Fit) -> float:
    """Share of the excess error at an effect's joint or link, at the time it was accepted, that is explained now: in its joint
    alone, if that was judged or stood out; on fixed-base takes alone, if they identified it. For a joint identified on
    floating-base takes, its own gap, if it has one, counts as much as all channels that depend on it, and the residuals of other
    effects do not count."""
    joint = t.candidate.joint
    outstanding = joint in standing_out(search, r.before, search.fitted)
    takes = search.fixed_base if search.is_settled(t.candidate) else search.fitted
    before, after = ({i: fit.residuals[i] for i in takes} for fit in (r.before, now))
    if t.joint is not None or joint is None or outstanding:
        return search.evaluator.share_closed(before, after, joint if outstanding else t.joint)
    others = {c.joint for c in now.effects if c.joint is not None} - {joint}
    everywhere = search.evaluator.share_closed(before, after, without=others)
    return max(everywhere, (everywhere + search.evaluator.share_closed(before, after, joint)) / 2)


def idle(search: Search, fit: Fit) -> list[Candidate]:
    """Effects that floating-base takes identified and that, in fine steps, bring too little: a coarse step's error may be what
    they made up for. fit: as fine steps judge it."""
    floating_terms = [(c, own) for c, own in zip(fit.effects, fit.slices()) if not search.is_settled(c) and c.size]
    if not floating_terms or not search.floating_base(search.fitted):
        return []
    points = np.tile(fit.x, (len(floating_terms), 1))
    for x, (_, own) in zip(points, floating_terms):
        x[own] = 0.0
    without = search.finely(fit, search.takes, *points)
    return [c for (c, _), f in zip(floating_terms, without) if f.cost["choose"] - fit.cost["choose"] < ACCEPTANCE.least_walking]
