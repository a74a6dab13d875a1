"""Channels of two rivals' takes, and how closely each rival imitates the other by adapting its own parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from workbench.compare.channels import BODY, body_channels
from workbench.compare.options import COMPARE
from workbench.experiment.options import EXPERIMENT
from workbench.experiment.rivals import Pair, Rival
from workbench.identify.options import PROBLEM
from workbench.identify.results.ties import ObservationModel
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.types import Array

Imitator = Literal["a", "b"]


@dataclass(frozen=True, eq=False)
class PairChannels:
    """The channels of a pair's takes, over sigma, flattened, with frames whose errors are correlated weighted to count as one.

    a, b (m,): of each rival. of_a, of_b (m, p): sensitivities of each to its own parameters; nuisance (m, k): to the unknowns of
    any recording, per standard deviation. channel (m,): index of each entry's channel. weight (m,): factor applied to the
    observations over sigma in a and b; counts (m,): the part of it that accounts for correlated errors, the rest for the
    numerical floor.
    """

    a: Array
    b: Array
    of_a: Array
    of_b: Array
    nuisance: Array
    channel: NDArray[np.int_]
    weight: Array
    counts: Array

    @staticmethod
    def join(parts: Sequence[PairChannels]) -> PairChannels:
        """The channels of takes that follow each other."""
        return PairChannels(*(np.concatenate([getattr(s, f.name) for s in parts]) for f in fields(PairChannels)))

    def chi_squared(self) -> float:
        """Cost of the better imitator: of the residual, and of moving far from the session's estimate."""
        return min(self.closest("a").cost, self.closest("b").cost)

    def closest(self, imitator: Imitator, x: Array | None = None, moving: bool = True) -> Closest:
        """How closely one rival imitates the other from parameters x (p,), by adapting them (if `moving`) and the unknowns of the
        recording."""
        S = self.of_a if imitator == "a" else self.of_b
        D = self.b - self.a if imitator == "a" else self.a - self.b
        x = np.zeros(S.shape[1]) if x is None else x
        p = S.shape[1] if moving else 0
        T = np.hstack([S[:, :p], self.nuisance])
        pull = np.concatenate([x[:p], np.zeros(self.nuisance.shape[1])])
        y = np.linalg.solve(T.T @ T + np.eye(T.shape[1]), T.T @ D - pull)
        at = x.copy()
        at[:p] += y[:p]
        left = D - T @ y
        return Closest(at, left / self.counts, float(left @ left + at @ at + y[p:] @ y[p:]))

    def rms(self, left: Array) -> Array:
        """RMS residual (m,) in each channel, over sigma."""
        return np.array([np.sqrt(np.mean(np.square(left[self.channel == c]))) for c in range(int(self.channel.max()) + 1)])


@dataclass(frozen=True, eq=False)
class Closest:
    """Parameters x (p,) in units of their freedom; the residual difference (m,), over sigma; chi squared of both."""

    x: Array
    left: Array
    cost: float


def channels(sight: ObservationModel, base: str) -> tuple[str, ...]:
    """Names of the observed channels: the joints that have a sigma, and on a free base the body's, where cameras see it."""
    return (*sight.sigma, *(BODY if base == "free" and sight.captured else ()))


def project(take: Take, sight: ObservationModel) -> Array:
    """Channels (N, c) of a simulated take over their sigma, rests left out."""
    take = take.zeroed_at_rest() if sight.captured else take.as_logged()
    q = take.q[:, [take.column(j) for j in sight.sigma]] / np.array(list(sight.sigma.values()))
    if take.base == "free" and sight.captured:
        q = np.hstack([q, body_channels(take) / PROBLEM.least_body_sigma])
    return np.asarray(np.nan_to_num(q[~take.resting]))


def project_pair(pair: Pair, takes: Sequence[Take], sight: ObservationModel, finer: Take | None = None) -> PairChannels:
    """The channels of a pair in takes of its models and of their neighbours, in that order. finer: the first rival's with the
    step halved, whose difference counts as error."""
    a, b, *others = (project(t, sight) for t in takes)
    floor = np.zeros(a.shape[1]) if finer is None else np.sqrt(np.mean(np.square(project(finer, sight) - a), axis=0))
    n, c = a.shape
    p = len(pair.a.steps())
    counts = _counts(sight, c)
    weight = counts / np.sqrt(1 + floor**2)
    of_a = [(o - a) / s for o, s in zip(others[:p], pair.a.steps())]
    of_b = [(o - b) / s for o, s in zip(others[p:], pair.b.steps())]
    unknowns = _flat(recording_unknowns(a, sight), weight, n)
    return PairChannels((weight * a).ravel(), (weight * b).ravel(), _flat(of_a, weight, n), _flat(of_b, weight, n), unknowns,
                        np.tile(np.arange(c), n), np.tile(weight, n), np.tile(counts, n))


def recording_unknowns(y: Array, sight: ObservationModel) -> list[Array]:
    """Unknowns of a recording, as changes of the channels (N, c) over sigma, each (N, c) by one standard deviation: the time of
    the first command, and the angle at which each joint was zeroed."""
    if not sight.captured:
        return []
    out = [np.gradient(y, axis=0) * sight.rate * EXPERIMENT.start]
    for i, sigma in enumerate(sight.sigma.values()):
        column = np.zeros(y.shape)
        column[:, i] = EXPERIMENT.zero / sigma
        out.append(column)
    return out


def with_channels(known: PairChannels, y: Array, imitator: Imitator) -> PairChannels:
    """The pair with other channels y (m,), over sigma, of the imitator."""
    return replace(known, a=known.weight * y) if imitator == "a" else replace(known, b=known.weight * y)


def _counts(sight: ObservationModel, count: int) -> Array:
    """For each channel (c,): the root of one over the number of frames with correlated errors; the body's are gains over a
    span."""
    counts = np.full(count, 1 / np.sqrt(max(1.0, EXPERIMENT.together * sight.rate)))
    counts[len(sight.sigma):] = 1 / np.sqrt(max(1.0, COMPARE.gain_span * sight.rate))
    return counts


def _flat(columns: Sequence[Array], weight: Array, frames: int) -> Array:
    if not columns:
        return np.zeros((frames * len(weight), 0))
    return np.stack([(weight * c).ravel() for c in columns], axis=1)


def fit_to_each_other(pair: Pair, known: PairChannels, play: Callable[[Sequence[RobotModel]], Sequence[Array]]) -> list[Closest]:
    """How closely each rival imitates the other: Gauss-Newton with the sensitivities that are known, both at once.

    play: rolls models out; returns the channels of each, over sigma, (m,) as in `known`.
    """
    rivals: dict[Imitator, Rival] = {"a": pair.a, "b": pair.b}
    best = {i: (known, known.closest(i, moving=False)) for i in rivals}
    settled = {i for i, r in rivals.items() if not len(r.steps())}
    for _ in range(EXPERIMENT.rounds):
        # the full step, and a shorter one in case the response is not linear
        trials = [(i, at.x + share * (here.closest(i, at.x).x - at.x))
                  for i, (here, at) in best.items() if i not in settled for share in (1.0, 0.4)]
        if not trials:
            break
        ends: dict[Imitator, list[tuple[PairChannels, Closest]]] = {}
        for (i, x), y in zip(trials, play([rivals[i].move(x).model for i, x in trials])):
            now = with_channels(known, y, i)
            ends.setdefault(i, []).append((now, now.closest(i, x, moving=False)))
        for i, options in ends.items():
            nearest = min(options, key=lambda o: o[1].cost)
            if nearest[1].cost > EXPERIMENT.settled * best[i][1].cost:
                settled.add(i)
            if nearest[1].cost < best[i][1].cost:
                best[i] = nearest
    return [at for _, at in best.values()]
