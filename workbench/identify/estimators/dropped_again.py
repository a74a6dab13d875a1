"""What is looked at anew once held takes have told what the robot is: which poses a servo never got, as the nominal robot may
have said so of what went otherwise for other reasons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from workbench.identify.estimators.dropped_commands import Missed, with_missed
from workbench.identify.fitting.fits import Fit, Search
from workbench.identify.parameters import with_effects
from workbench.identify.problem import TakeEvidence
from workbench.identify.rollouts import Jury, Question


@dataclass(frozen=True)
class Played:
    """sent: takes with all poses that went out; missed: what was taken for missed, and left out of what is played."""

    sent: Jury
    missed: tuple[Missed, ...] = ()


def read_anew(search: Search, current: Fit, played: Played) -> tuple[Search, Played]:
    """Missed poses as the robot with these effects tells them, and the search on takes that are played without these; the same
    search where they are those that were known."""
    model, sent = with_effects(search.nominal, current.sizes()), played.sent
    residuals = sent.residuals([Question(model, tuple(range(len(sent.evidence))))])[0]
    jury, missed = with_missed(sent, model, residuals)
    if _poses(missed) != _poses(played.missed):
        search = search.on(search.jury.on(played_as(search.jury.evidence, jury.evidence)))
    return search, replace(played, missed=missed)


def played_as(evidence: Sequence[TakeEvidence], others: Sequence[TakeEvidence]) -> list[TakeEvidence]:
    """Takes played as others are, which are the same takes."""
    return [replace(e, take=o.take) for e, o in zip(evidence, others)]


def _poses(missed: Sequence[Missed]) -> Mapping[str, Mapping[int, tuple[int, ...]]]:
    return {m.joint: m.poses for m in missed}
