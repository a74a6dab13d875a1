"""What is looked at anew once held takes have told what the robot is: which poses a servo never got, as the nominal robot may
have said so of what went otherwise for other reasons, and what steps and contact models leave open of walks, as it walks
otherwise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from workbench.gap.candidate import with_effects
from workbench.gap.compare_session import Run, roll_out
from workbench.gap.evidence import TakeEvidence, weighed
from workbench.gap.jury import Jury, Question
from workbench.gap.missed import Missed, with_missed
from workbench.gap.race import Trial
from workbench.gap.rounds import Round
from workbench.gap.search import Fit, Search

STEPS = 4
"""Of a fit to takes that are played or weighed otherwise."""
OTHERWISE = 1.0
"""Mean square, over sigma, of what effects change of takes on the ground, from which on these are weighed anew."""


@dataclass(frozen=True)
class Played:
    """sent: takes with all poses that went out; missed: what was taken for missed, and left out of what is played."""

    sent: Jury
    missed: tuple[Missed, ...] = ()


def looked_at_anew(search: Search, current: Fit, nominal: Fit, rounds: list[Round], played: Played | None
                   ) -> tuple[Fit, Fit, list[Round], Played | None]:
    """What was found with the base held, what there was before, and how it came, as takes that are looked at anew judge it."""
    jury = search.jury
    if played is not None:
        played = read_anew(search, current, played)
    if search.jury is not jury:
        current = search.refitted(search.evaluated(current.sizes()), search.held or search.fitted, STEPS)
        nominal = search.evaluated([])
    if search.grounded(search.fitted) and goes_otherwise(search, nominal, current):
        weigh_anew(search, current)
    if search.jury is jury:
        return current, nominal, rounds, played
    return judged(search, current), search.evaluated([]), [replace(r, before=judged(search, r.before)) for r in rounds], played


def weighed_again(search: Search, current: Fit, takes: tuple[int, ...], rounds: list[Round], since: int) -> Fit:
    """`current` fitted to walks that it weighs; all rounds as these judge them, and what was tried from the one `since` on in
    shares of what is found now."""
    was = rounds[since].before.cost["choose"] - current.cost["choose"]
    weigh_anew(search, current)
    if search.settled is not None:
        search.settled = judged(search, search.settled)
    rounds[:] = [replace(r, before=judged(search, r.before)) for r in rounds]
    current = search.refitted(judged(search, current), takes, STEPS)
    share = (rounds[since].before.cost["choose"] - current.cost["choose"]) / max(was, 1.0)
    rounds[since:] = [replace(r, trials=tuple(_scaled(t, share) for t in r.trials),
                              accepted=tuple(_scaled(t, share) for t in r.accepted)) for r in rounds[since:]]
    return current


def _scaled(t: Trial, share: float) -> Trial:
    return replace(t, gain={use: share * g for use, g in t.gain.items()}, by_channel=share * t.by_channel)


def judged(search: Search, fit: Fit) -> Fit:
    """A fit as the search's takes judge it now."""
    return replace(search.evaluated(fit.sizes()), covariance=fit.covariance, slopes=fit.slopes)


def read_anew(search: Search, current: Fit, played: Played) -> Played:
    """Missed poses as the robot with these effects tells them; the search's takes are played without these instead."""
    model, sent = with_effects(search.nominal, current.sizes()), played.sent
    residuals = sent.residuals([Question(model, tuple(range(len(sent.evidence))))])[0]
    jury, missed = with_missed(sent, model, residuals)
    if _poses(missed) != _poses(played.missed):
        search.jury = search.jury.on([replace(e, take=o.take) for e, o in zip(search.jury.evidence, jury.evidence)])
    return replace(played, missed=missed)


def goes_otherwise(search: Search, nominal: Fit, current: Fit) -> bool:
    """Whether what was found with the base held makes another walk of it."""
    jury, walks = search.jury, search.grounded(search.fitted)
    changes = {i: nominal.residuals[i] - current.residuals[i] for i in walks}
    uses = ("fit", "choose")
    return sum(jury.cost(changes, use) for use in uses) > OTHERWISE * sum(jury.expected(walks, use) for use in uses)


def weigh_anew(search: Search, current: Fit) -> None:
    """Weighs the search's takes on the ground by the robot with these effects."""
    jury = search.jury
    model = with_effects(search.nominal, current.sizes())
    walks = [i for i in range(len(jury.evidence)) if jury.walks((i,))]
    takes = [jury.evidence[i].take for i in walks]
    models = [model.with_servos(t.spec.servos) for t in takes]
    rollouts = roll_out([Run(t.spec.name, m, t.commands, t.duration, t.spec.base) for t, m in zip(takes, models)],
                        jury.config, n_jobs=jury.n_jobs)
    evidence = list(jury.evidence)
    for i, r, m in zip(walks, rollouts, models):
        evidence[i] = weighed(evidence[i], r, m)
    search.jury = jury.on(evidence)


def as_looked_at(evidence: Sequence[TakeEvidence], others: Sequence[TakeEvidence]) -> list[TakeEvidence]:
    """Takes played and weighed as others are, which are the same takes."""
    return [replace(e, take=o.take, sigma=o.sigma, offset=o.offset, contact=o.contact) for e, o in zip(evidence, others)]


def _poses(missed: Sequence[Missed]) -> Mapping[str, Mapping[int, tuple[int, ...]]]:
    return {m.joint: m.poses for m in missed}
