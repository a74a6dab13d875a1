"""Fits of effects by rollouts: one effect at many joints at once, one at the whole robot, several together."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.gap.candidates import Candidate
from workbench.gap.fitting import WALKING, Solved, fit_blocks, through, together
from workbench.gap.jury import COARSE, FINE, Jury, Question
from workbench.gap.metrics import rms
from workbench.robot import RobotModel

Array = NDArray[np.float64]
Report = Callable[[str, float | None], None]
SCANNED, SCANNED_WALKING = (1.0, 4.0), (0.7, 2.0)
"""Sizes, in typical ones, at which an effect is looked at before it is fitted."""
FAR, FAR_WALKING = 5.0, 1.6
"""Times the size it was looked at that an effect's signature is believed to grow: a foot grips or slips, which no line tells."""
WORTH = 0.4
"""Share of the best gain at its place, as signatures foretell it, from which on an effect is fitted."""
SEEN_ELSEWHERE = ("zero_offset",)
"""What leaves no trace in the angles of its own joint, as they are zeroed, but in what gravity and ground do."""
BEHIND = 0.6
"""Share of the best gain at its place after one step of the fit, from which on an effect is fitted to its end."""
MOST_FITTED = 3
"""Effects of the whole robot, of feet or links that are fitted at a time: those of which signatures foretell most."""
Asking = Generator[list[Question], list[dict[int, Array]], "list[Trial]"]


@dataclass(frozen=True)
class Trial:
    """A candidate fitted beside the effects there were. gain: of chi squared by use; closed: share of what was beyond noise on
    the choosing stretches; joint: whose channels alone were looked at, None for all. foretold: whether signatures alone said so
    much less of it than of a rival that no fit was made."""

    candidate: Candidate
    x: Array
    gain: Mapping[str, float]
    joint: str | None
    foretold: bool = False
    closed: float = 0.0


@dataclass(frozen=True)
class Fit:
    """Effects fitted together. x: sizes of all their numbers; covariance of x, infinite where the data say nothing.

    cost: chi squared by use ("fit", "choose", "validate"); residuals by take. jacobian: of what is fitted on all takes.
    """

    effects: tuple[Candidate, ...]
    x: Array
    covariance: Array
    cost: dict[str, float]
    residuals: dict[int, Array] = field(repr=False)
    jacobian: Array | None = field(default=None, repr=False)

    def slices(self) -> list[slice]:
        """Of x, for each effect."""
        ends = np.cumsum([0, *(c.size for c in self.effects)]).tolist()
        return [slice(a, b) for a, b in pairwise(ends)]

    def sizes(self) -> list[tuple[Candidate, Array]]:
        """Each effect with its own sizes."""
        return [(c, self.x[s]) for c, s in zip(self.effects, self.slices())]

    def model(self, nominal: RobotModel) -> RobotModel:
        """The nominal robot with these effects."""
        return with_effects(nominal, self.sizes())


def with_effects(nominal: RobotModel, effects: Sequence[tuple[Candidate, Array]]) -> RobotModel:
    """The nominal robot with effects of given sizes, one after the other."""
    return replace(nominal, effects=(*nominal.effects, *(c.spec(x) for c, x in effects)))


@dataclass(frozen=True)
class Race:
    """What rivals that are fitted side by side know of each other: the best gain that signatures foretell and that a first step
    reached, by joint; wide: what is foretold of each that concerns all joints."""

    foretold: dict[str | None, float] = field(default_factory=dict)
    reached: dict[str | None, float] = field(default_factory=dict)
    wide: list[float] = field(default_factory=list)


def _tell(best: dict[str | None, float], joints: Sequence[str | None], gains: Sequence[float]) -> None:
    for j, gain in zip(joints, gains):
        best[j] = max(best.get(j, 0.0), gain)


def _best(best: dict[str | None, float], joint: str | None) -> float:
    """At a joint; of all, for what concerns all."""
    return max(best.values()) if joint is None else best[joint]


class Search:
    """Fits on one session."""

    def __init__(self, jury: Jury, nominal: RobotModel) -> None:
        self.jury, self.nominal = jury, nominal
        self.takes = tuple(range(len(jury.evidence)))
        self.fitted = tuple(i for i, e in enumerate(jury.evidence) if e.uses["fit"].any() or e.uses["choose"].any())

    def evaluated(self, effects: Sequence[tuple[Candidate, Array]], covariance: Array | None = None) -> Fit:
        """Effects as they are, on all takes."""
        residuals = self.jury.residuals([Question(with_effects(self.nominal, effects), self.takes)])[0]
        x = np.concatenate([np.empty(0), *(x for _, x in effects)])
        covariance = np.full((len(x), len(x)), np.inf) if covariance is None else covariance
        return Fit(tuple(c for c, _ in effects), x, covariance, self._cost(residuals), residuals)

    def tried(self, current: Fit, groups: Sequence[Sequence[Candidate]], takes: Mapping[int, tuple[int, ...]],
              report: Callable[[float], None], iterations: int = 3, starts: Mapping[Any, Array] | None = None) -> list[Trial]:
        """Every group fitted beside `current`, all in lockstep. A group is one candidate, or one effect at several joints,
        each judged by its own joint's channels. takes: on which, by group. starts: sizes by candidate's key, found already; all
        are then fitted, and judged by all channels."""
        race = Race()
        asking = {n: self._trying(current, group, takes[n], race, iterations, starts) for n, group in enumerate(groups)}
        done = together(asking, lambda wanted: self.jury.residuals([q for _, q in wanted]), report)
        return [trial for n in range(len(groups)) for trial in done[n]]

    def _trying(self, current: Fit, group: Sequence[Candidate], takes: tuple[int, ...],
                race: Race, iterations: int, given: Mapping[Any, Array] | None) -> Asking:
        jury, apart = self.jury, given is None and group[0].joint is not None and group[0].name not in SEEN_ELSEWHERE
        joints = [c.joint if apart else None for c in group]
        base = {i: current.residuals[i] for i in takes}
        r0 = [jury.vector(base, "fit", j) for j in joints]

        def question(sizes: Sequence[Array | None], step: float = 1.0) -> Question:
            new = [(c, x) for c, x in zip(group, sizes) if x is not None]
            return Question(with_effects(self.nominal, [*current.sizes(), *new]), takes, step)

        def left(answer: dict[int, Array]) -> list[Array]:
            return [jury.vector(answer, "fit", j) for j in joints]

        walking = self._stride(takes) == WALKING
        probes = _scan(group[0], SCANNED_WALKING if walking else SCANNED) if given is None else []
        none: list[Array | None] = [None] * len(group)
        answers = (yield [question(none, COARSE), *(question([p] * len(group), COARSE) for p in probes)]) if probes else []
        seen = [[r + v - w for r, v, w in zip(r0, left(a), left(answers[0]))] for a in answers[1:]]
        far = FAR_WALKING if walking else FAR
        guesses = [_guess(c, r0[b], probes, [v[b] for v in seen], far) if given is None else (given[c.key], np.inf)
                   for b, c in enumerate(group)]
        starts, gains = [g[0] for g in guesses], [g[1] for g in guesses]
        race.wide.extend(g for j, g in zip(joints, gains) if j is None)
        _tell(race.foretold, joints, gains)
        yield []  # until all have said what they foretell
        last = sorted(race.wide, reverse=True)[:MOST_FITTED][-1] if race.wide else 0.0
        worth = [g > 0 and g >= WORTH * _best(race.foretold, j) and (j is not None or g >= last) for j, g in zip(joints, gains)]
        alive = [b for b, w in enumerate(worth) if w]
        if given is None and walking:
            iterations = 1 if apart else 2  # those ahead are fitted again, with all that was chosen or by all that they do
        out = [Trial(c, x, {"fit": min(g, 0.0), "choose": min(g, 0.0)}, j, foretold=True)
               for c, x, g, j, w in zip(group, starts, gains, joints, worth) if not w]
        if not alive:
            return out

        def spread(point: Sequence[Array]) -> list[Array | None]:
            sizes: list[Array | None] = [None] * len(group)
            for b, x in zip(alive, point):
                sizes[b] = x
            return sizes

        bounds = [group[b].bounds() for b in alive]
        points = [[share * starts[b] for b in alive] for share in ((1.0, 0.5) if walking else (1.0,))]
        firsts = [left(a) for a in (yield [question(spread(p)) for p in points])]
        nearest = [int(np.argmin([f[b] @ f[b] for f in firsts])) for b in alive]
        begin = [points[n][k] for k, n in enumerate(nearest)]
        begin_left = [firsts[n][b] for b, n in zip(alive, nearest)]

        def improved(start: list[Array], leaves: list[Array], n: int, slopes: Sequence[Array] | None = None
                     ) -> Generator[list[Question], list[dict[int, Array]], list[Solved]]:
            fit = fit_blocks(start, leaves, bounds, n, self._stride(takes), slopes)
            return (yield from through(fit, lambda p: question(spread(p)), lambda answer: [left(answer)[b] for b in alive]))

        solved = yield from improved(begin, begin_left, 1)
        off_fit = [float(r0[b] @ r0[b]) - s.cost for b, s in zip(alive, solved)]
        _tell(race.reached, [joints[b] for b in alive], off_fit)
        yield []  # until all have come as far
        if iterations > 1 and any(gain > BEHIND * _best(race.reached, joints[b]) for b, gain in zip(alive, off_fit)):
            solved = yield from improved([s.x for s in solved], [s.r for s in solved], iterations - 1, [s.J for s in solved])
        final = (yield [question(spread([s.x for s in solved]))])[0]
        for b, s in zip(alive, solved):
            off = {use: float(np.sum(jury.vector(base, use, joints[b]) ** 2) - np.sum(jury.vector(final, use, joints[b]) ** 2))
                   for use in ("fit", "choose")}
            was = jury.vector(base, "choose", joints[b])
            beyond = float(was @ was) - jury.expected(takes, "choose", joints[b])
            out.append(Trial(group[b], s.x, off, joints[b], closed=off["choose"] / max(beyond, 1.0)))
        return out

    def refitted(self, current: Fit, takes: tuple[int, ...], iterations: int, free: Sequence[int] | None = None) -> Fit:
        """All effects' sizes fitted together (or those of the effects listed in `free`), with their covariance."""
        chosen = list(range(len(current.effects))) if free is None else list(free)
        moving = np.concatenate([np.empty(0, dtype=int), *(np.arange(s.start, s.stop) for i, s in enumerate(current.slices())
                                                           if i in chosen)]).astype(int)
        if not len(moving):
            return current
        ends = [c.bounds() for c in current.effects]
        low, high = (np.concatenate([e[k] for e in ends])[moving] for k in (0, 1))

        def question(point: Sequence[Array]) -> Question:
            x = current.x.copy()
            x[moving] = point[0]
            return Question(with_effects(self.nominal, list(zip(current.effects, [x[s] for s in current.slices()]))), takes)

        r0 = self.jury.vector({i: current.residuals[i] for i in takes}, "fit")
        fit = fit_blocks([current.x[moving]], [r0], [(low, high)], iterations, self._stride(takes))
        asking = through(fit, question, lambda answer: [self.jury.vector(answer, "fit")])
        (solved,) = together({0: asking}, lambda wanted: self.jury.residuals([q for _, q in wanted]))[0]
        x = current.x.copy()
        x[moving] = solved.x
        covariance = np.full((len(x), len(x)), np.inf)
        covariance[np.ix_(moving, moving)] = _covariance(solved)
        fitted = self.evaluated(list(zip(current.effects, [x[s] for s in current.slices()])), covariance)
        return replace(fitted, jacobian=solved.J) if takes == self.fitted and len(moving) == len(x) else fitted

    def refined(self, fit: Fit) -> Fit:
        """The fit with its numbers as FINE steps want them, and what it leaves there: a step's error bends numbers by several per
        cent. One Gauss-Newton step with the search's Jacobian, halved while it makes things worse; a quarter of the way counts
        as a standard deviation more."""
        x = fit.x
        last = self._finely(fit, x)
        J = fit.jacobian
        if J is None or not len(x) or not np.isfinite(fit.covariance).any():
            return last
        r = self.jury.vector(last.residuals, "fit")
        move = -np.linalg.lstsq(J.T @ J + 1e-6 * np.diag(np.diag(J.T @ J) + 1e-12), J.T @ r, rcond=None)[0]
        low, high = (np.concatenate([c.bounds()[k] for c in fit.effects]) for k in (0, 1))
        for share in (1.0, 0.4):
            there = self._finely(fit, np.clip(x + share * move, low, high))
            if there.cost["fit"] < last.cost["fit"]:
                return replace(there, covariance=fit.covariance + np.diag(((there.x - x) / 4) ** 2))
        return last

    def floors(self, fit: Fit) -> dict[int, Array]:
        """Numerical floor (c,) of a refined fit's channels, over sigma, by take: what FINE steps twice as long change."""
        model = with_effects(self.nominal, fit.sizes())
        longer = self.jury.residuals([Question(model, self.takes, 2 * FINE)])[0]
        return {i: np.nan_to_num(rms((longer[i] - fit.residuals[i])[self.jury.evidence[i].moving])) for i in self.takes}

    def _stride(self, takes: Sequence[int]) -> float:
        return WALKING if any(self.jury.evidence[i].take.spec.base == "free" for i in takes) else 0.15

    def _finely(self, fit: Fit, x: Array) -> Fit:
        effects = list(zip(fit.effects, [x[s] for s in fit.slices()]))
        residuals = self.jury.residuals([Question(with_effects(self.nominal, effects), self.takes, FINE)])[0]
        return replace(fit, x=x, cost=self._cost(residuals), residuals=residuals)

    def _cost(self, residuals: dict[int, Array]) -> dict[str, float]:
        return {use: float(np.sum(self.jury.vector(residuals, use) ** 2)) for use in ("fit", "choose", "validate")}


def _covariance(solved: Solved) -> Array:
    """Of a block's sizes, inflated where residuals are larger than their sigma says; infinite where nothing depends on them."""
    H = solved.J.T @ solved.J
    known = np.diag(H) > 1e-9
    out = np.full(H.shape, np.inf)
    if not known.any():
        return out
    scale = np.sqrt(np.diag(H)[known])
    values, vectors = np.linalg.eigh(H[np.ix_(known, known)] / np.outer(scale, scale))
    samples = max(1, int(np.count_nonzero(solved.r)))
    inner = (vectors / np.maximum(values, 1e-9)) @ vectors.T / np.outer(scale, scale) * max(1.0, solved.cost / samples)
    out[np.ix_(known, known)] = inner
    return out


def _scan(c: Candidate, sizes: Sequence[float]) -> list[Array]:
    """Sizes at which a candidate is looked at: of one number, several; of more, each alone."""
    if c.read_off:
        return [np.ones(c.size)]
    probes = c.probes()
    if len(probes) > 1 or not c.size:
        return probes
    low, high = c.bounds()
    points = [np.clip(s * probes[0], low, high) for s in sizes]
    return [p for k, p in enumerate(points) if not any(np.allclose(p, other) for other in points[:k])]


def _guess(c: Candidate, r0: Array, probes: Sequence[Array], seen: Sequence[Array], far: float) -> tuple[Array, float]:
    """Sizes to start from, and how much of the sum of squares signatures say they take away."""
    whole = float(r0 @ r0)
    if not c.size:
        return np.empty(0), whole - float(seen[0] @ seen[0])
    low, high = c.bounds()
    if np.linalg.matrix_rank(np.array(probes)) > 1:  # several numbers, not one at several sizes
        S = np.stack([(v - r0) for v in seen], axis=1)
        shares, *_ = np.linalg.lstsq(S, -r0, rcond=1e-8)
        return np.clip(c.combined(shares), low, high), whole - float(np.sum((r0 + S @ shares) ** 2))
    best = (probes[0], -np.inf)
    for p, v in zip(probes, seen):
        S = v - r0
        power = float(S @ S)
        size = float(np.clip(-(S @ r0) / power, -far, far)) if power > 1e-9 else 0.0
        x = np.clip(size * p, low, high)
        gain = whole - float(np.sum((r0 + S * float(x @ p / max(float(p @ p), 1e-9))) ** 2))
        if gain > best[1]:
            best = (x, gain)
    return best
