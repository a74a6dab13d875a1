"""Dropped commands, estimated again once the fixed-base takes have identified the servos: compared with the nominal robot, a
motion that differs for other reasons may look like a command that never arrived."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.registry import estimated_by
from workbench.identify.estimators.dropped_commands import DroppedCommands, with_dropped_commands
from workbench.identify.estimators.dropped_in_motion import played_without
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.parameters import with_effects
from workbench.identify.problem import TakeEvidence
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.robot import RobotModel


@dataclass(frozen=True)
class TakesAsPlayed:
    """sent: takes with all poses that were sent; missed: poses first taken for missed, which are not played; without: effects
    that are not searched for."""

    sent: RolloutEvaluator
    missed: tuple[DroppedCommands, ...] = ()
    without: frozenset[str] = frozenset()

    def as_found(self) -> RolloutEvaluator:
        """The takes played without the missed poses."""
        return played_without(self.sent, {(i, m.joint): poses for m in self.missed for i, poses in m.poses.items()})

    def without_missed(self, model: RobotModel, residuals: Mapping[int, NDArray[np.float64]]
                       ) -> tuple[RolloutEvaluator, tuple[DroppedCommands, ...]]:
        """An evaluator whose takes are played without the missed poses, and these poses. residuals: the model's."""
        if self.without.intersection(e.name for e in estimated_by("missed poses")):
            return self.sent, ()
        return with_dropped_commands(self.sent, model, residuals)


def reestimate(search: Search, current: Fit, played: TakesAsPlayed) -> tuple[Search, TakesAsPlayed]:
    """Missed poses as the robot with these effects tells them, and the search on takes that are played without these; the same
    search where they are those that were known."""
    model, sent = with_effects(search.nominal, current.sizes()), played.sent
    residuals = sent.residuals([RolloutRequest(model, tuple(range(len(sent.evidence))))])[0]
    evaluator, missed = played.without_missed(model, residuals)
    if _poses(missed) != _poses(played.missed):
        search = search.on(search.evaluator.on(with_commands_of(search.evaluator.evidence, evaluator.evidence)))
    return search, replace(played, missed=missed)


def with_commands_of(evidence: Sequence[TakeEvidence], others: Sequence[TakeEvidence]) -> list[TakeEvidence]:
    """Takes played as others are, which are the same takes, or as much of them as is looked at."""
    return [e.played(o.take.commands) for e, o in zip(evidence, others)]


def _poses(missed: Sequence[DroppedCommands]) -> Mapping[str, Mapping[int, tuple[int, ...]]]:
    return {m.joint: m.poses for m in missed}
