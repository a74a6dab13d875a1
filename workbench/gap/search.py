"""Fits of effects by rollouts: one effect at many joints at once, one at the whole robot, several together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from workbench.gap.candidates import Candidate, with_effects
from workbench.gap.fitting import HELD, NEAR, WALKING, WIDE, Solved, fit_blocks, lowest, through, together
from workbench.gap.jury import FINE, Jury, Question, take_of
from workbench.gap.metrics import rms
from workbench.gap.race import Part, Race, Signatures, Trial, Trying
from workbench.robot import RobotModel

Array = NDArray[np.float64]
T = TypeVar("T")
Report = Callable[[str, float | None], None]
SEEN_ELSEWHERE = ("zero_offset",)
"""What leaves no trace in the angles of its own joint, as they are zeroed, but in what gravity and ground do."""

RESETTLING = 3
"""Steps of a fit of effects that were settled before."""
ENGINES = 0.06
"""Standard deviation, as a share of a number, that contact adds where a walk tells it: engines, and robots, differ by that."""


@dataclass(frozen=True)
class Slopes:
    """What some numbers of a fit (indices of x) do to what is fitted (`vector`) on some takes, in the search's step."""

    numbers: NDArray[np.int_]
    takes: tuple[int, ...]
    J: Array


@dataclass(frozen=True)
class Fit:
    """Effects fitted together. x: sizes of all their numbers; covariance of x, infinite where the data say nothing.

    cost: chi squared by use ("fit", "choose", "validate"); residuals by take.
    """

    effects: tuple[Candidate, ...]
    x: Array
    covariance: Array
    cost: dict[str, float]
    residuals: dict[int, Array] = field(repr=False)
    slopes: tuple[Slopes, ...] = field(default=(), repr=False)

    def slices(self) -> list[slice]:
        """Of x, for each effect."""
        ends = np.cumsum([0, *(c.size for c in self.effects)]).tolist()
        return [slice(a, b) for a, b in pairwise(ends)]

    def numbers(self, effects: Iterable[int]) -> NDArray[np.int_]:
        """Indices of x, of some effects."""
        slices = self.slices()
        return np.concatenate([np.empty(0, dtype=int), *(np.arange(slices[i].start, slices[i].stop) for i in effects)])

    def sizes(self, x: Array | None = None) -> list[tuple[Candidate, Array]]:
        """Each effect with its own sizes; with those of another x."""
        x = self.x if x is None else x
        return [(c, x[s]) for c, s in zip(self.effects, self.slices())]

    def bounds(self) -> tuple[Array, Array]:
        """Of x."""
        ends = [(np.empty(0), np.empty(0)), *(c.bounds() for c in self.effects)]
        return np.concatenate([low for low, _ in ends]), np.concatenate([high for _, high in ends])

    def model(self, nominal: RobotModel) -> RobotModel:
        """The nominal robot with these effects."""
        return with_effects(nominal, self.sizes())


class Search:
    """Fits on one session.

    settled: effects that showed with the base held, as held takes tell them: these keep their numbers in all fits that follow,
    as contact bends what walks tell.
    """

    def __init__(self, jury: Jury, nominal: RobotModel) -> None:
        self.jury, self.nominal = jury, nominal
        self.takes = tuple(range(len(jury.evidence)))
        self.fitted = tuple(i for i, e in enumerate(jury.evidence) if e.uses["fit"].any() or e.uses["choose"].any())
        self.held = tuple(i for i in self.fitted if not jury.walks((i,)))
        self.settled: Fit | None = None
        self.signatures: Signatures = {}

    def is_settled(self, c: Candidate) -> bool:
        """Whether held takes told its numbers."""
        return self.settled is not None and c.key in {e.key for e in self.settled.effects}

    def grounded(self, takes: tuple[int, ...]) -> tuple[int, ...]:
        """Of these takes, those whose base is not held."""
        return tuple(i for i in takes if i not in self.held)

    def telling(self, effects: Iterable[Candidate], takes: tuple[int, ...]) -> tuple[int, ...]:
        """Of these takes, those that tell numbers of effects: where some walk these alone, unless an effect is of the whole robot
        or of the cameras; what held takes show of a joint or a link has been asked before."""
        grounded = self.grounded(takes)
        alone = all(c.effect.layer in ("ground", "inertia") or (c.where and c.effect.layer != "measurement") for c in effects)
        return grounded if grounded and alone else takes

    def resettled(self, current: Fit, *more: Candidate) -> Fit:
        """`current` with those that are settled, and `more`, fitted anew on held takes: for when one went or another came."""
        there = [s for s in current.sizes() if self.is_settled(s[0]) or s[0].key in {c.key for c in more}]
        self.settled = None
        self.settled = self.refitted(self.evaluated(there), self.held, RESETTLING, range(len(there)))
        told = {c.key: x for c, x in self.settled.sizes()}
        return self.evaluated([(c, told.get(c.key, x)) for c, x in current.sizes()])

    def evaluated(self, effects: Sequence[tuple[Candidate, Array]]) -> Fit:
        """Effects as they are, on all takes."""
        return self.side_by_side([self.evaluating(effects)])[0][0]

    def evaluating(self, *lists: Sequence[tuple[Candidate, Array]]) -> Part[list[Fit]]:
        """Several lists of effects as they are, on all takes, as part of something that goes on beside others."""
        answers = yield [Question(with_effects(self.nominal, effects), self.takes) for effects in lists]
        out = []
        for effects, residuals in zip(lists, answers):
            x = np.concatenate([np.empty(0), *(x for _, x in effects)])
            out.append(Fit(tuple(c for c, _ in effects), x, np.full((len(x), len(x)), np.inf), self._cost(residuals), residuals))
        return out

    def side_by_side(self, parts: Sequence[Part[T]], report: Callable[[float], None] = lambda share: None) -> list[T]:
        """What several parts return; their rollouts share batches."""
        done = together(dict(enumerate(parts)), lambda wanted: self.jury.residuals([q for _, q in wanted]), report)
        return [done[n] for n in range(len(parts))]

    def tried(self, current: Fit, groups: Sequence[Sequence[Candidate]], takes: Mapping[int, tuple[int, ...]],
              report: Callable[[float], None], ahead: float = 0.0) -> list[Trial]:
        """Every group fitted beside `current`, all in lockstep. A group is one candidate, or, while the base is held, one effect
        at several joints, each judged by its own joint's channels. takes: on which, by group.
        ahead: gain on fitted stretches of the best of rivals tried before, for those judged by all channels."""
        race, asking = Race({None: ahead}, {None: ahead}, {None: ahead}), []
        for n, group in enumerate(groups):
            apart = group[0].joint is not None and group[0].name not in SEEN_ELSEWHERE and not self.jury.walks(takes[n])
            base = {i: current.residuals[i] for i in takes[n]}
            asking.append(Trying(self.jury, self.nominal, current.sizes(), base, group, race, apart, self.signatures).run())
        return [trial for trials in self.side_by_side(asking, report) for trial in trials]

    def refitted(self, current: Fit, takes: tuple[int, ...], iterations: int, free: Sequence[int] | None = None) -> Fit:
        """Effects' sizes fitted together (all that are not settled, or those listed in `free`), with their covariance."""
        return self.side_by_side([self.refitting(current, takes, iterations, free)])[0]

    def refitting(self, current: Fit, takes: tuple[int, ...], iterations: int, free: Sequence[int] | None = None) -> Part[Fit]:
        """The same as part of something that goes on beside others."""
        moved = [i for i, c in enumerate(current.effects) if not self.is_settled(c)] if free is None else list(free)
        moving = current.numbers(moved)
        if not len(moving):
            return self._told_held(current)
        takes = self.telling([current.effects[i] for i in moved], takes)
        low, high = (ends[moving] for ends in current.bounds())

        def question(point: Sequence[Array]) -> Question:
            x = current.x.copy()
            x[moving] = point[0]
            return Question(with_effects(self.nominal, current.sizes(x)), takes)

        # several numbers share what a walk shows: a short move of one drowns
        near = np.concatenate([np.full(c.size, NEAR if c.size == 1 else WALKING) for c in current.effects])[moving]
        stride = near if self.jury.walks(takes) else HELD
        r0 = self.jury.vector({i: current.residuals[i] for i in takes}, "fit")
        fit = fit_blocks([current.x[moving]], [r0], [(low, high)], iterations, stride)
        (solved,) = yield from through(fit, question, lambda answer: [self.jury.vector(answer, "fit")])
        x = current.x.copy()
        x[moving] = solved.x
        covariance = np.full((len(x), len(x)), np.inf)
        stretches = self.jury.stretches(takes, "fit")
        spread = np.hypot(ENGINES * np.abs(solved.x) * self._walked(solved, stretches), self._bent_by_contact(solved, takes))
        covariance[np.ix_(moving, moving)] = _covariance(solved, stretches) + np.diag(spread**2)
        (there,) = yield from self.evaluating(current.sizes(x))
        return self._told_held(replace(there, covariance=covariance, slopes=(Slopes(moving, takes, solved.J),)))

    def _told_held(self, fit: Fit) -> Fit:
        """With covariance and slopes of those that are settled."""
        if self.settled is None:
            return fit
        where = {c.key: i for i, c in enumerate(self.settled.effects)}
        both = [(i, where[c.key]) for i, c in enumerate(fit.effects) if c.key in where]
        here, there = fit.numbers(i for i, _ in both), self.settled.numbers(k for _, k in both)
        covariance = fit.covariance.copy()
        covariance[here], covariance[:, here] = np.inf, np.inf
        covariance[np.ix_(here, here)] = self.settled.covariance[np.ix_(there, there)]
        slopes = [Slopes(here, s.takes, s.J[:, [s.numbers.tolist().index(n) for n in there]]) for s in self.settled.slopes]
        others = [s for s in fit.slopes if not np.isin(s.numbers, here).any()]
        return replace(fit, covariance=covariance, slopes=(*others, *slopes))

    def refined(self, fit: Fit) -> Fit:
        """The fit with its numbers as FINE steps want them, and what it leaves there: a step's error bends numbers by several per
        cent. One Gauss-Newton step with the search's slopes, shortened where it makes things worse; of the one number that walks
        tell, if it is one, the bottom of what is seen far around. A quarter of the way counts as a standard deviation more."""
        if not fit.slopes or not np.isfinite(fit.covariance).any():
            return self._finely(fit, self.takes, fit.x)[0]
        walked = fit.numbers([i for i, c in enumerate(fit.effects) if not self.is_settled(c)])
        alone = int(walked[0]) if len(walked) == 1 and self.held != self.fitted else None
        takes = self.takes if len(walked) else self.held or self.takes
        seen = self._finely(fit, takes, *([fit.x] if alone is None else _around(fit, alone)))
        move, start = self._newton(seen[0]), fit.x.copy()
        low, high = fit.bounds()
        if alone is not None:
            move[alone] = 0.0
            start[alone] = _bottom(seen, alone, (low[alone], high[alone]))
        for share in (1.0, 0.4) if alone is None else (1.0,):
            seen += self._finely(fit, takes, np.clip(start + share * move, low, high))
            if seen[-1].cost["fit"] < seen[0].cost["fit"]:
                break
        (best,) = self._finely(fit, self.takes, min(seen, key=lambda f: f.cost["fit"]).x)
        return replace(best, covariance=fit.covariance + np.diag(((best.x - fit.x) / 4) ** 2))

    def _newton(self, seen: Fit) -> Array:
        """A Gauss-Newton step from what a fit leaves in fine steps, with the search's slopes."""
        move = np.zeros(len(seen.x))
        for s in seen.slopes:
            r = self.jury.vector({i: seen.residuals[i] for i in s.takes}, "fit")
            H = s.J.T @ s.J
            move[s.numbers] = -np.linalg.lstsq(H + 1e-6 * np.diag(np.diag(H) + 1e-12), s.J.T @ r, rcond=None)[0]
        return move

    def floors(self, fit: Fit) -> dict[int, Array]:
        """Numerical floor (c,) of a refined fit's channels, over sigma, by take: what FINE steps twice as long change."""
        model = with_effects(self.nominal, fit.sizes())
        longer = self.jury.residuals([Question(model, self.takes, 2 * FINE)])[0]
        return {i: np.nan_to_num(rms((longer[i] - fit.residuals[i])[self.jury.evidence[i].moving])) for i in self.takes}

    def _walked(self, solved: Solved, stretches: NDArray[np.int_]) -> Array:
        """Share of what is known of each number that walks tell."""
        free = [i for i in self.takes if self.jury.walks((i,))]
        told = np.sum(solved.J**2, axis=0)
        walks = np.sum(solved.J[np.isin(take_of(stretches), free)] ** 2, axis=0)
        return np.asarray(np.divide(walks, told, out=np.zeros_like(told), where=told > 0))

    def _bent_by_contact(self, solved: Solved, takes: Sequence[int]) -> Array:
        """By how much the other contact model would move each number: it is as right as this one, in every stretch alike."""
        other = self.jury.vector({i: self.jury.evidence[i].contact / self.jury.evidence[i].sigma for i in takes}, "fit")
        scale = np.sqrt(np.sum(solved.J**2, axis=0)) + 1e-9
        return np.asarray(np.linalg.lstsq(solved.J / scale, other, rcond=1e-6)[0] / scale)

    def _finely(self, fit: Fit, takes: tuple[int, ...], *points: Array) -> list[Fit]:
        """The fit with other sizes, as FINE steps judge it."""
        asked = [Question(with_effects(self.nominal, fit.sizes(x)), takes, FINE) for x in points]
        return [replace(fit, x=x, cost=self._cost(r), residuals=r) for x, r in zip(points, self.jury.residuals(asked))]

    def _cost(self, residuals: dict[int, Array]) -> dict[str, float]:
        return {use: self.jury.cost(residuals, use) for use in ("fit", "choose", "validate")}


def _around(fit: Fit, n: int) -> list[Array]:
    """The fit's sizes, and those with number n far on both sides."""
    low, high = fit.bounds()
    x = np.array([fit.x] * 3)
    x[1:, n] *= 1 + WIDE, 1 / (1 + WIDE)
    return list(np.clip(x, low, high))


def _bottom(seen: Sequence[Fit], n: int, ends: tuple[float, float]) -> float:
    """Of number n, the bottom of the parabola through three fits, or where the best of them has it."""
    bottom = lowest([(f.x[[n]], f.cost["fit"]) for f in seen], *(np.array([end]) for end in ends))
    return float(min(seen, key=lambda f: f.cost["fit"]).x[n] if bottom is None else bottom[0])


def _covariance(solved: Solved, stretches: NDArray[np.int_]) -> Array:
    """Of a block's sizes: what the scatter between stretches says, as neighbouring frames and joints err together (clustered
    sandwich; K.-Y. Liang and S. L. Zeger, Biometrika 73, 1986), at least what that between frames does; infinite where nothing
    depends on them."""
    H = solved.J.T @ solved.J
    known = np.diag(H) > 1e-9
    out = np.full(H.shape, np.inf)
    if not known.any():
        return out
    scale = np.sqrt(np.diag(H)[known])
    values, vectors = np.linalg.eigh(H[np.ix_(known, known)] / np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-9)) @ vectors.T / np.outer(scale, scale)
    samples = max(1, int(np.count_nonzero(solved.r)))
    frames = inverse * max(1.0, solved.cost / samples)
    _, which = np.unique(stretches, return_inverse=True)
    count = int(which.max()) + 1
    scores = np.zeros((count, int(known.sum())))
    np.add.at(scores, which, solved.J[:, known] * solved.r[:, None])
    between = inverse @ (scores.T @ scores) @ inverse * count / max(1, count - 1)
    wider = np.sqrt(np.maximum(1.0, np.diag(frames) / np.maximum(np.diag(between), 1e-30)))
    out[np.ix_(known, known)] = between * np.outer(wider, wider)
    return out
