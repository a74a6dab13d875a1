"""The next experiment: a motion, within the servos' limits, that separates explanations which a session could not separate.

Segments of motion that load, reverse, jerk or hold the joints concerned are rolled out with both rivals. A segment is scored by
the residual difference between the two, over sigma, after the better imitator has adapted its own parameters as closely as
possible: where a somewhat softer spring imitates a flatter servo law, the score is zero. Segments are then combined greedily, so
that a rival which can imitate the other in one segment cannot in the next; the resulting motion is rolled out as a whole and each
rival is fitted to the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from workbench.effects.registry import effect_named
from workbench.experiment.limits import Reach
from workbench.experiment.moves import JointMoves, long_runs
from workbench.experiment.options import EXPERIMENT
from workbench.experiment.projection import (
    ObservationModel,
    PairChannels,
    channels,
    fit_to_each_other,
    project,
    project_pair,
    with_channels,
)
from workbench.experiment.rivals import Pair
from workbench.experiment.runs import Runs, spans
from workbench.experiment.segment import Segment
from workbench.experiment.stance import BodyMoves
from workbench.identify.results.findings import NextExperiment
from workbench.motion import Motion
from workbench.recording.take import Take
from workbench.robot import RobotModel, legs
from workbench.types import Array, Progress, no_progress

__all__ = ["Experiment", "ObservationModel", "Separation", "design_experiment"]

Base = Literal["free", "fixed"]


@dataclass(frozen=True)
class Separation:
    """How far a motion separates two rivals after each was fitted to the other, by the better imitator.

    effects: the names of the two. where: the channel (joint, or of the body) that separates them best; in_sigma: RMS difference
    there, over sigma. log_likelihood_ratio: expected, of the true one over the other; frames with correlated errors count as one.
    """

    effects: tuple[str, str]
    where: str
    in_sigma: float
    log_likelihood_ratio: float

    @property
    def separated(self) -> bool:
        """Whether the motion is expected to tell the two apart."""
        return self.log_likelihood_ratio >= EXPERIMENT.separated


@dataclass(frozen=True, eq=False)
class Experiment:
    """A motion to record next, on a base free or fixed; separations: of the pairs asked for, in their order."""

    motion: Motion
    base: Base
    separations: tuple[Separation, ...]

    def entry(self, file: str = "next_experiment.csv") -> NextExperiment | None:
        """The experiment's entry in findings.json; None where nothing would be separated. file: name of the motion's file."""
        separated = [s for s in self.separations if s.separated]
        if not separated:
            return None
        ratios = tuple(s.log_likelihood_ratio for s in separated)
        return NextExperiment(file, self.base, tuple(s.effects for s in separated), ratios)


def design_experiment(nominal: RobotModel, rivals: Sequence[tuple[RobotModel, RobotModel]],
                      observations: Mapping[Base, ObservationModel], n_jobs: int = 2, progress: Progress = no_progress
                      ) -> Experiment:
    """The motion that best separates rivals.

    nominal: the robot without effects. rivals: pairs of fitted models (nominal and effects) that a session cannot tell apart, the
    most urgent first; effects that only one of a pair has may adapt their numbers. observations: how the next recording will
    see the robot on each base that is allowed. ValueError without rivals or bases. The same call gives the same motion.
    """
    if not rivals or not observations:
        raise ValueError("expected at least one pair of rivals, and one base")
    pairs = [Pair.of(a, b) for a, b in rivals]
    best: Experiment | None = None
    for base in sorted(observations, key=lambda b: b != _better_base(pairs[0], nominal)):
        experiment = _Bench(nominal, base, observations[base], n_jobs, progress).design(pairs)
        if best is None or _worth(experiment.separations) > _worth(best.separations):
            best = experiment
        if all(s.separated for s in best.separations):
            break
    assert best is not None
    return best


def _worth(separations: Iterable[Separation]) -> float:
    return sum(math.log1p(s.log_likelihood_ratio) for s in separations)


def _better_base(pair: Pair, nominal: RobotModel) -> Base:
    """The ground, and masses on the base itself, are observable on a free base alone; effects in a joint are best on a fixed
    one."""
    ground = any(effect_named(e.effect).layer == "ground" for e in pair.effects)
    carried = any(w in (nominal.base, *_trunk(nominal)) for e in pair.effects for w in e.where)
    return "free" if ground or carried else "fixed"


def _trunk(model: RobotModel) -> list[str]:
    """Links from which the legs hang."""
    return [model.kinematics.frames[leg[0]].parent for leg in legs(model).values() if leg]


def _focus(pair: Pair, model: RobotModel) -> tuple[str, ...]:
    """The joints that a pair concerns: its own; the joint that carries its link; else thighs and knees, or all of them."""
    k = model.kinematics
    named = [w if w in model.joints else k.parent_joint.get(w) for e in pair.effects for w in e.where]
    joints = tuple(dict.fromkeys(j for j in named if j in model.joints))
    if joints:
        return joints
    return tuple(j for leg in legs(model).values() for j in leg[-2:]) or model.joints


class _Bench:
    """Designs the experiment on one base: tries segments, combines them, and verifies the whole motion."""

    def __init__(self, nominal: RobotModel, base: Base, sight: ObservationModel, n_jobs: int, progress: Progress) -> None:
        self.nominal, self.base, self.sight, self.progress = nominal, base, sight, progress
        self.reach = Reach(nominal)
        self.runs = Runs(self.reach, base, sight, n_jobs, progress)

    def design(self, pairs: Sequence[Pair]) -> Experiment:
        """The best motion for these pairs; a rest of a second where no segment separates any."""
        pieces: dict[str, Segment] = {}
        tried: list[dict[str, PairChannels]] = []
        for i, pair in enumerate(pairs):
            library = self._library(pair)
            pieces |= {s.name: s for s in library}
            tried.append(self._try_pieces(pair, library, f"trying motions, {i + 1} of {len(pairs)}"))
        chosen = [pieces[name] for name in _choose_segments(pieces, tried)]
        if not chosen:
            still = Segment("rest", self.base, np.array([0.0, 1.0]), np.zeros((2, len(self.nominal.joints))))
            return Experiment(self.runs.motion([still]), self.base, tuple(Separation(p.names, "", 0.0, 0.0) for p in pairs))
        separations = tuple(self._verify(p, chosen, shows) for p, shows in zip(pairs, tried))
        return Experiment(self.runs.motion(chosen), self.base, separations)

    def _library(self, pair: Pair) -> list[Segment]:
        if self.base == "free":
            return BodyMoves(self.nominal, self.reach).segments()
        focus = _focus(pair, self.nominal)
        pieces = JointMoves(self.nominal, self.reach, focus).segments()
        lasting = any(not e.where for e in pair.effects)
        return pieces + (long_runs(self.nominal, self.reach, focus, EXPERIMENT.longest) if lasting else [])

    def _try_pieces(self, pair: Pair, library: Sequence[Segment], what: str) -> dict[str, PairChannels]:
        """The channels of a pair on each segment, by its name: of both rivals on all segments, of their neighbours on those where
        the two differ most."""
        takes = self.runs.play_all(pair.models, [[s] for s in library], what)
        rough = {s.name: (s, of, project_pair(pair, of, self.sight)) for s, of in zip(library, takes) if self.runs.sound(of)}
        best = sorted(rough.values(), key=lambda r: -r[2].closest("a", moving=False).cost)[:EXPERIMENT.kept]
        if not best:
            return {}
        kept = [[s] for s, *_ in best]
        beside = self.runs.play_all(pair.neighbours, kept, what) if pair.neighbours else [[] for _ in kept]
        finer: list[Take | None] = [None for _ in kept]
        if self.base == "free":  # a robot on its feet multiplies small errors; one on a stand hardly does
            finer = [fine for fine, in self.runs.play_all(pair.models[:1], kept, what, EXPERIMENT.time_step / 2)]
        return {s.name: project_pair(pair, [*of, *more], self.sight, fine)
                for (s, of, _), more, fine in zip(best, beside, finer) if self.runs.sound(more)}

    def _verify(self, pair: Pair, chosen: Sequence[Segment], tried: Mapping[str, PairChannels]) -> Separation:
        """Residual difference of two rivals on the whole motion, each fitted to the other by rollouts."""
        named = [s.name for s in chosen if s.name in tried]
        if not named:
            return Separation(pair.names, "", 0.0, 0.0)
        frames = np.concatenate([np.r_[span] for name, span in spans(chosen, self.sight.rate).items() if name in named])

        def play(models: Sequence[RobotModel]) -> list[Array]:
            stage = f"fitting {pair.names[0]} and {pair.names[1]} to each other"
            return [project(take, self.sight)[frames].ravel() for take in self.runs.play_all(models, [chosen], stage)[0]]

        known = PairChannels.join([tried[name] for name in named])
        a, b = play(pair.models)
        known = with_channels(with_channels(known, a, "a"), b, "b")
        nearest = min(fit_to_each_other(pair, known, play), key=lambda c: c.cost)
        rms = known.rms(nearest.left)
        where = channels(self.sight, self.base)[int(np.argmax(rms))]
        return Separation(pair.names, where, float(rms.max()), nearest.cost / 2)


def _choose_segments(pieces: Mapping[str, Segment], tried: Sequence[Mapping[str, PairChannels]]) -> list[str]:
    """Chooses the segments to play, in order; tried: how well each separates each pair."""

    def value(names: Sequence[str]) -> float:
        shows = [[of[name] for name in names if name in of] for of in tried]
        return sum(math.log1p(PairChannels.join(s).chi_squared() / 2) for s in shows if s)

    def fits(names: Sequence[str]) -> bool:
        alone = any(pieces[name].long for name in names)
        return sum(pieces[name].duration for name in names) <= EXPERIMENT.longest and not (alone and len(names) > 1)

    useful = [name for name in pieces if any(name in of for of in tried)]
    chosen: list[str] = []
    had = 0.0
    while True:
        options = [[*chosen, name] for name in useful if name not in chosen and fits([*chosen, name])]
        values = [value(o) for o in options]
        if not values or max(values) <= had + EXPERIMENT.worth:
            return chosen
        had = max(values)
        chosen = options[values.index(had)]
