"""Poses that a servo never got: read off each take, as which ones are missed is chance and no search finds chance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.effects.registry import effect_named, estimated_by
from workbench.identify.estimators.dropped_in_motion import dropped_in_motion, ends_of, played_without, steps
from workbench.identify.fitting.fit import Fit
from workbench.identify.fitting.fits import Search
from workbench.identify.options import READ_OFF
from workbench.identify.parameters import with_effects
from workbench.identify.problem import TakeEvidence, joint_error
from workbench.identify.results.findings import Change, Estimate, Finding
from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest
from workbench.robot import EffectSpec, RobotModel
from workbench.types import Array


@dataclass(frozen=True)
class DroppedCommands:
    """One joint's missed poses, by take. effect: the name of what misses them; of: how many would have moved the joint, in all
    takes."""

    effect: str
    joint: str
    poses: Mapping[int, tuple[int, ...]]
    of: int
    fit: Change
    validation: Change

    @property
    def count(self) -> int:
        """Of poses that the joint missed, in all takes."""
        return sum(map(len, self.poses.values()))

    @property
    def probability(self) -> float:
        """With which a pose is missed."""
        return self.count / self.of

    @property
    def mean(self) -> float:
        """Of the effect's number: the probability."""
        return self.probability

    @property
    def variance(self) -> float:
        """Of the probability, by the binomial distribution."""
        return self.probability * (1 - self.probability) / self.of

    @property
    def spec(self) -> EffectSpec:
        """The effect, for a model."""
        return EffectSpec(self.effect, (self.joint,), {self._parameter: self.probability})

    @property
    def _parameter(self) -> str:
        return effect_named(self.effect).parameters[0].name

    def finding(self) -> Finding:
        """With the 90 % interval of a share (Clopper and Pearson 1934)."""
        from scipy.stats import binomtest  # half a second of imports, which most diagnoses do without

        low, high = binomtest(self.count, self.of).proportion_ci(0.9, "exact")
        number = Estimate(self.probability, float(low), float(high), "1")
        said = effect_named(self.effect).sentence(self.spec) + f" ({self.count} of {self.of} here.)"
        return Finding(self.effect, (self.joint,), READ_OFF.dropped_probability, {self._parameter: number}, self.fit,
                       self.validation, evidence=said)


def with_dropped_commands(
    evaluator: RolloutEvaluator, nominal: RobotModel, residuals: Mapping[int, Array]
) -> tuple[RolloutEvaluator, tuple[DroppedCommands, ...]]:
    """An evaluator whose takes are played without the missed poses, and these poses. residuals: of the nominal robot."""
    effect, *_ = (*estimated_by("missed poses"), None)
    if effect is None:
        return evaluator, ()
    found: list[DroppedCommands] = []
    moving = dropped_in_motion(evaluator, nominal, residuals)
    for joint in dict.fromkeys(j for e in evaluator.evidence for j in e.joints):
        here = [i for i, e in enumerate(evaluator.evidence) if joint in e.joints and e.take.commands]
        lost, after = poses_lost(evaluator, nominal, joint, {i: moving.get((i, joint), ()) for i in here}, residuals)
        count, of = sum(map(len, lost.values())), sum(_telling(evaluator.evidence[i], joint, k) for i, k in lost.items())
        least = least_explained(evaluator, {i: len(k) for i, k in lost.items()})
        if least is None or count > READ_OFF.most_dropped * of or stands_at_an_end(evaluator.evidence, joint, lost):
            continue
        gone = {i: k for i, k in lost.items() if k}
        columns = {i: evaluator.evidence[i].columns(joint) for i in gone}
        was, now = (float(sum(np.nansum(np.square(r[i][:, own])) for i, own in columns.items())) for r in (residuals, after))
        frames = sum(np.isfinite(residuals[i][:, own]).sum() for i, own in columns.items())
        if was - now > least * (was - frames) and was - now > 100:
            fit, unseen = (Change(joint_error(evaluator.evidence, [joint], residuals, use),
                                  joint_error(evaluator.evidence, [joint], after, use), "deg") for use in ("fit", "validate"))
            found.append(DroppedCommands(effect.name, joint, gone, of, fit, unseen))
            evaluator, residuals = played_without(evaluator, {(i, joint): k for i, k in gone.items()}), after
    return evaluator, tuple(found)


def poses_lost(evaluator: RolloutEvaluator, nominal: RobotModel, joint: str, known: Mapping[int, tuple[int, ...]],
               residuals: Mapping[int, Array]) -> tuple[dict[int, tuple[int, ...]], dict[int, Array]]:
    """Poses that a joint missed, by take, and the residuals of the takes played without them. known: those missed in motion.
    Poses after a missed one are examined again, compared with a robot that did not receive it either."""
    lost, now = dict(known), dict(residuals)
    new = {i: k for i, k in lost.items() if k}
    for _ in range(READ_OFF.turns):
        if new:
            tried = played_without(evaluator, {(i, joint): lost[i] for i in new})
            now |= tried.residuals([RolloutRequest(nominal, tuple(new))])[0]
        new = {i: more for i in lost if (more := _read(evaluator.evidence[i], joint, now[i], lost[i]))}
        if not new:
            break
        lost |= {i: tuple(sorted((*lost[i], *more))) for i, more in new.items()}
    return lost, now


def least_explained(evaluator: RolloutEvaluator, missed: Mapping[int, int]) -> float | None:
    """Share of the joint's gap that so many missed poses, by take, must explain; None: not believed. On the ground a joint may be
    kept from going, once."""
    fixed = [n for i, n in missed.items() if evaluator.evidence[i].take.spec.base == "fixed"]
    if sum(fixed):
        return READ_OFF.dropped_explains
    return (READ_OFF.dropped_explains_free if fixed else READ_OFF.dropped_explains) if sum(missed.values()) > 1 else None


def stands_at_an_end(evidence: Sequence[TakeEvidence], joint: str, lost: Mapping[int, Sequence[int]]) -> bool:
    """Whether every pose that seems missed demands an angle beyond all that the joint reached, while the joint stands at the end
    of that range, as it does at a mechanical stop. lost: poses by take."""
    ends: dict[float, float] = {}  # furthest angle reached, by direction
    for i, poses in lost.items():
        commands = evidence[i].take.commands
        assert commands is not None
        seen, frames = _observed_angle(evidence[i], joint), _at_the_end(evidence[i])
        for k in poses:
            goal, last = float(commands.goals[k, commands.column(joint)]), seen[frames[k]]
            stood = float(np.median(last[np.isfinite(last)]))
            way = 1.0 if goal > stood else -1.0
            if way not in ends:
                went = (way * _observed_angle(e, joint) for e in evidence if joint in e.joints)
                ends[way] = max(float(np.nanquantile(angle, 0.995)) for angle in went)
            if not (way * goal > ends[way] and way * stood > ends[way] - READ_OFF.at_stop):
                return False
    return True


def _observed_angle(e: TakeEvidence, joint: str) -> Array:
    """Where a joint was [rad], the zero being the servo's."""
    return np.asarray(e.recorded[:, e.channels.index(joint)] + e.zero(joint))


def _at_the_end(e: TakeEvidence) -> Sequence[slice]:
    """For each command, the last frames before the next one comes; for the last command, all later frames."""
    time, ends = e.since, ends_of(e)
    first, after = (np.searchsorted(time, t, side="right") for t in (ends - 0.06, ends))
    after[-1:] = len(time)
    return [slice(a, b) for a, b in zip(first.tolist(), after.tolist())]


def _read(e: TakeEvidence, joint: str, residual: Array, gone: Sequence[int]) -> tuple[int, ...]:
    """Commands that a joint missed in addition to the known ones (gone), judged by its motion until the next command. After one,
    none until the joint reaches a goal again: the model received a command that the joint did not."""
    commands = e.take.commands
    assert commands is not None
    i, known = e.channels.index(joint), set(gone)
    seen, frames = _observed_angle(e, joint), _at_the_end(e)
    said = seen - residual[:, i] * e.sigma[i]
    at, missed, alike = 0.0, list[int](), True
    for k, goal in enumerate(commands.goals[:, commands.column(joint)].tolist()):
        if k in known:
            continue
        way, good = goal - at, np.isfinite(seen[frames[k]])
        if abs(way) < READ_OFF.least_step or not good.any():
            at = goal
            continue
        went = _middle(seen, frames[k], good, at) / way
        if alike and abs(went) < READ_OFF.stayed and _middle(said, frames[k], good, at) / way > READ_OFF.went:
            missed.append(k)
            alike = False
        else:
            at = goal
            alike = alike or abs(went - 1) < READ_OFF.stayed
    return tuple(missed)


def _middle(angle: Array, frames: slice, good: NDArray[np.bool_], since: float) -> float:
    """Median displacement of a joint from `since` [rad] over the good frames."""
    return float(np.median(angle[frames][good]) - since)


def _telling(e: TakeEvidence, joint: str, gone: Sequence[int]) -> int:
    """How many poses would have moved a joint, as it was seen to do or not."""
    seen, frames, missed = np.isfinite(_observed_angle(e, joint)), _at_the_end(e), set(gone)
    return sum(k in missed or bool(seen[frames[k]].any()) for k in {*steps(e, joint, gone), *missed})


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

    def without_missed(self, model: RobotModel, residuals: Mapping[int, Array]
                       ) -> tuple[RolloutEvaluator, tuple[DroppedCommands, ...]]:
        """An evaluator whose takes are played without the missed poses, and these poses. residuals: the model's."""
        if self.without.intersection(e.name for e in estimated_by("missed poses")):
            return self.sent, ()
        return with_dropped_commands(self.sent, model, residuals)


def reestimate(search: Search, current: Fit, played: TakesAsPlayed) -> tuple[Search, TakesAsPlayed]:
    """Missed poses as the robot with these effects tells them, and the search on takes that are played without these; the same
    search where they are those that were known. Compared with the nominal robot, a motion that differs for other reasons may look
    like a command that never arrived."""
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
