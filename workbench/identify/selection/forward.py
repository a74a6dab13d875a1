"""Forward selection: which effects are accepted, judged on stretches that no fit used.

First on fixed-base takes, where only the servos move the robot; then, with those effects in the model, on takes on the
ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from workbench.compare.channels import BODY, joint_of
from workbench.identify.estimators.dropped_commands import TakesAsPlayed, reestimate
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.options import FIT
from workbench.identify.parameters import Candidate
from workbench.identify.problem import channel_gaps
from workbench.identify.selection.acceptance import is_acceptable, least_closed, remaining, too_little_left
from workbench.identify.selection.best_subsets import fitted_beside, penalised_cost, selection_steps
from workbench.identify.selection.options import ACCEPTANCE, FORWARD, SCHEDULING, SUBSETS
from workbench.identify.selection.pair_move import with_pair
from workbench.identify.selection.reconsider import (
    checked_on_fixed_base,
    left_to_chance,
    reevaluate,
    without_idle,
    without_part_answers,
)
from workbench.identify.selection.record import CandidateFit, SelectionResult, SelectionStep, before_rough
from workbench.identify.selection.scheduling import groups_to_try, standing_out
from workbench.identify.selection.screening import fit_groups
from workbench.identify.selection.swap import sets_at_worst_joint
from workbench.types import Progress


def select(search: Search, pool: Sequence[Candidate], report: Progress, thorough: bool = False,
           played: TakesAsPlayed | None = None) -> SelectionResult:
    """The accepted effects. thorough: without a limit of work; else, once it is reached, the trials so far decide. played: the
    takes without commands that never arrived, read again with the effects identified on fixed-base takes."""
    current = nominal = search.evaluate([])
    rounds: list[SelectionStep] = []
    most = np.inf if thorough else max(FORWARD.most_work, FORWARD.most_rollouts * search.evaluator.seconds)
    if search.fixed_base:
        search, current, rounds = _phase(search, pool, current, search.fixed_base, rounds, report, most)
    if current.effects and played is not None:
        report("looking again", None)
        begun = search
        search, played = reestimate(search, current, played)
        if search is not begun:
            rounds = [replace(r, before=search.evaluate(r.before.sizes())) for r in rounds]
            there = search.evaluate(current.sizes())
            current = search.refit(there, search.fixed_base or search.fitted, FORWARD.replayed_steps)
        nominal = search.evaluate([])
    if search.fixed_base != search.fitted:
        current = search.refit_timing(current)
        search = search.with_settled(current)
        closed = least_closed(search, nominal, current)
        search, current, rounds = _phase(search, pool, current, search.fitted, rounds, report, most, closed)
        current, rounds = with_pair(search, pool, current, rounds, report)
    kept = without_part_answers(search, current, rounds)
    if len(kept.effects):
        report("fitting together", None)
        kept = without_idle(search, kept)
        if {c.key for c in current.effects if search.is_settled(c)} - {c.key for c in kept.effects}:
            search, kept = search.resettle(kept)
        if kept is not current or _may_go_on(search, kept):
            kept = search.refit(kept, search.fitted, FORWARD.last_steps)
    return SelectionResult(search, kept, tuple(rounds), played.missed if played else ())


def _may_go_on(search: Search, fit: Fit) -> bool:
    """Whether a fit may not have come to its end: where floating-base takes still show a gap, as fits of several numbers begin in
    coarse steps."""
    return any(channel_gaps(search.evaluator.evidence[i], fit.residuals[i]) for i in search.floating_base(search.fitted))


def _phase(search: Search, pool: Sequence[Candidate], current: Fit, takes: tuple[int, ...], rounds: Sequence[SelectionStep],
           report: Progress, most_work: float, closed: float = ACCEPTANCE.least_closed
           ) -> tuple[Search, Fit, list[SelectionStep]]:
    """Accepts effects one after the other while they gain enough. closed: the share of the excess error that each must remove; if
    it is higher than usual, only joints that stand out and effects of the whole robot are tried on the ground."""
    stopped, rounds = False, list(rounds)
    least = ACCEPTANCE.least_walking if search.evaluator.any_floating(takes) else ACCEPTANCE.all_closed * FIT.least_gain
    for _ in range(FORWARD.most_rounds):
        beyond = remaining(search, current, before_rough(rounds, current), takes)
        if stopped or not beyond or too_little_left(search, current, takes, rounds):
            break
        what = ", ".join(sorted({joint_of(c) if c not in BODY else "body" for c in beyond}))
        say = partial(report, f"explaining {what} ({len(rounds) + 1})")
        trials: list[CandidateFit] = []
        likely = pool
        for tier in range(SCHEDULING.tiers_of_all if closed > ACCEPTANCE.least_closed else SCHEDULING.tiers):
            stopped = search.evaluator.memory.work > most_work
            if stopped:
                break
            groups, on = groups_to_try(search, likely, current, beyond, takes, tier)
            ahead = max((t.gain["fit"] for t in trials if t.joint is None), default=0.0)
            trials += fit_groups(search, current, groups, on, say, ahead, least)
            trials.sort(key=lambda t: -t.gain["choose"])
            # what closes all but brings too little is no answer: the rest of what moves the robot as a whole is asked, too
            improves = bool(trials) and (_says_it(search, current, trials[0], takes, tier)
                                         or _is_of_all(search, current, trials[0], takes, beyond))
            if improves and (tier + 1 >= SCHEDULING.tiers_of_all or is_acceptable(search, trials[0], takes, rounds, current)):
                if not _tips(search, trials[0], takes, tier):
                    break
                likely = [c for c in pool if c.effect.moves_center]
        worth = [t for t in trials if t.closed > closed and is_acceptable(search, t, takes, rounds, current)]
        choices = _accept(worth)
        fits = search.side_by_side([fitted_beside(search, current, accepted, takes, SUBSETS.most_steps) for accepted in choices])
        after, accepted = min(zip(fits, choices), key=lambda f: penalised_cost(f[0]), default=(current, []))
        sizes = {c.key: x for fit in fits for c, x in fit.sizes()}
        taken_in = [
            SelectionStep(current, tuple(replace(t, x=sizes.get(t.candidate.key, t.x)) for t in trials), tuple(accepted), stopped)
        ]
        read_off = any(t.candidate.read_off for t in accepted)  # lines do not tell what goes with a stop: ask again beside it
        of_all = bool(accepted) and _is_of_all(search, current, accepted[0], takes, beyond)
        sets = [] if stopped or read_off or of_all else sets_at_worst_joint(search, current, trials, takes, beyond)
        if sets and penalised_cost(sets[0][0]) < SUBSETS.half * penalised_cost(after):
            after = sets[0][0]
            taken_in = [replace(taken_in[0], accepted=()), *selection_steps(search, current, sets)]
        rounds += taken_in
        if after is current:
            break
        search, current = left_to_chance(search, after, current.sizes_by_key())
        if search.evaluator.any_floating(takes):
            search, current = checked_on_fixed_base(search, current, [t.candidate for t in accepted])
        else:
            current, rounds = reevaluate(search, current, rounds, takes)
    if search.evaluator.any_floating(takes):
        current, rounds = reevaluate(search, current, rounds, takes)
    return search, current, rounds


def _says_it(search: Search, current: Fit, t: CandidateFit, takes: tuple[int, ...], tier: int) -> bool:
    """Whether the best so far leaves nothing worth asking in the tiers that follow."""
    surely = tier < SCHEDULING.tiers_of_all or not search.evaluator.any_floating(takes)
    if surely and t.joint is None and t.candidate.joint in standing_out(search, current, takes):
        closed = _closed_at(search, current, t, takes, t.candidate.joint)
        return t.gain["choose"] > ACCEPTANCE.least_walking and closed > FORWARD.own_gap
    if not surely:
        return t.closed > FORWARD.enough
    return t.closed > (FORWARD.nearly_all_walking if search.evaluator.any_floating(takes) else SUBSETS.nearly_all)


def _tips(search: Search, t: CandidateFit, takes: tuple[int, ...], tier: int) -> bool:
    """Whether centres of mass of links that are asked last are not to be passed over: they tip a robot on the ground as the best
    so far does. A load there, with a number more, does so wherever it hangs, which tells nothing."""
    return search.evaluator.any_floating(takes) and tier + 1 < SCHEDULING.tiers_of_all and t.candidate.effect.layer == "inertia"


def _is_of_all(search: Search, current: Fit, t: CandidateFit, takes: tuple[int, ...], beyond: dict[str, float]) -> bool:
    """Whether an effect of the whole robot takes nearly all away of what most joints lack on a fixed base: they lack it in
    common, whatever more one of them lacks."""
    joints = {joint_of(c) for c in beyond if c not in BODY}
    if t.candidate.where or len(joints) <= SCHEDULING.few or search.evaluator.any_floating(takes):
        return False
    return float(np.median([_closed_at(search, current, t, takes, j) for j in joints])) > SUBSETS.nearly_all


def _closed_at(search: Search, current: Fit, t: CandidateFit, takes: tuple[int, ...], joint: str | None) -> float:
    """Share of the excess error in a joint that is removed by an effect judged by every channel."""
    if not len(t.by_channel):
        return 0.0
    here = search.telling([t.candidate], takes)
    cost, expected = search.evaluator.by_channel({i: current.residuals[i] for i in here}, "choose")
    own = np.concatenate([np.isin(e.columns(), e.columns(joint)) for e in (search.evaluator.evidence[i] for i in here)])
    return float(np.sum(t.by_channel[own]) / max(1.0, np.sum(np.maximum(cost - expected, 0.0)[own])))


def _accept(worth: Sequence[CandidateFit]) -> list[list[CandidateFit]]:
    """Which to take, of those that are worth it: the best and the best at other joints where it is about as good; of the whole
    robot's the best, but not what leaves half where another closes nearly all. Where the screening does not show which is ahead,
    each of them to be fitted."""
    if not worth:
        return []
    best = worth[0]
    if best.joint is None:
        close = [t for t in worth if t.joint is None and t.gain["choose"] > (1 - FORWARD.close) * best.gain["choose"]]
        whole = [t for t in close if t.closed > SUBSETS.nearly_all] if best.closed < ACCEPTANCE.last_closed else []
        return [[t] for t in (whole or close)[:FORWARD.most_rivals + 1]]
    # recordings that end at a stop show it, whatever else keeps a stiff spring ahead of it for now
    shown = next((t for t in worth if t.candidate.read_off and t.joint == best.joint
                  and t.gain["choose"] > FORWARD.halfway * best.gain["choose"]), None)
    best = shown or best
    elsewhere: list[CandidateFit] = []
    for t in worth:
        alike = t.gain["choose"] > FORWARD.alike * best.gain["choose"] or t.closed > SUBSETS.nearly_all
        if alike and t.joint not in {None, best.joint, *(o.joint for o in elsewhere)}:
            elsewhere.append(t)
    rivals = [] if shown else [t for t in worth[1:] if t.joint == best.joint and best.closed < SUBSETS.nearly_all
                               and t.gain["choose"] > FORWARD.halfway * best.gain["choose"]]
    return [[t, *elsewhere] for t in (best, *rivals[:FORWARD.most_rivals])]
