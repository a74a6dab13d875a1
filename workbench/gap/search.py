"""Fits of effects by rollouts: one effect at many joints at once, one at the whole robot, several together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from workbench.gap.candidates import Candidate, with_effects
from workbench.gap.fitting import HELD, NEAR, WALKING, Solved, fit_blocks, through, together
from workbench.gap.jury import FINE, Jury, Question, take_of
from workbench.gap.metrics import rms
from workbench.gap.race import Race, Trial, Trying
from workbench.robot import RobotModel

Array = NDArray[np.float64]
Report = Callable[[str, float | None], None]
SEEN_ELSEWHERE = ("zero_offset",)
"""What leaves no trace in the angles of its own joint, as they are zeroed, but in what gravity and ground do."""

ENGINES = 0.06
"""Standard deviation, as a share of a number, that contact adds where a walk tells it: engines, and robots, differ by that."""


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
              report: Callable[[float], None], ahead: float = 0.0) -> list[Trial]:
        """Every group fitted beside `current`, all in lockstep. A group is one candidate, or, while the base is held, one effect
        at several joints, each judged by its own joint's channels. takes: on which, by group.
        ahead: gain on fitted stretches of the best of rivals tried before, for those judged by all channels."""
        race, asking = Race({None: ahead}, {None: ahead}), {}
        for n, group in enumerate(groups):
            apart = group[0].joint is not None and group[0].name not in SEEN_ELSEWHERE and not self.jury.walks(takes[n])
            base = {i: current.residuals[i] for i in takes[n]}
            asking[n] = Trying(self.jury, self.nominal, current.sizes(), base, group, race, apart).run()
        done = together(asking, lambda wanted: self.jury.residuals([q for _, q in wanted]), report)
        return [trial for n in range(len(groups)) for trial in done[n]]

    def refitted(self, current: Fit, takes: tuple[int, ...], iterations: int, free: Sequence[int] | None = None) -> Fit:
        """All effects' sizes fitted together (or those of the effects listed in `free`), with their covariance."""
        chosen = list(range(len(current.effects))) if free is None else list(free)
        moving = np.concatenate([np.empty(0, dtype=int), *(np.arange(s.start, s.stop) for i, s in enumerate(current.slices())
                                                           if i in chosen)]).astype(int)
        if not len(moving):
            return current
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
        asking = through(fit, question, lambda answer: [self.jury.vector(answer, "fit")])
        (solved,) = together({0: asking}, lambda wanted: self.jury.residuals([q for _, q in wanted]))[0]
        x = current.x.copy()
        x[moving] = solved.x
        covariance = np.full((len(x), len(x)), np.inf)
        stretches = self.jury.stretches(takes, "fit")
        spread = ENGINES * np.abs(solved.x) * self._walked(solved, stretches)
        covariance[np.ix_(moving, moving)] = _covariance(solved, stretches) + np.diag(spread**2)
        fitted = self.evaluated(current.sizes(x), covariance)
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
        low, high = fit.bounds()
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

    def _walked(self, solved: Solved, stretches: NDArray[np.int_]) -> Array:
        """Share of what is known of each number that walks tell."""
        free = [i for i in self.takes if self.jury.walks((i,))]
        told = np.sum(solved.J**2, axis=0)
        walks = np.sum(solved.J[np.isin(take_of(stretches), free)] ** 2, axis=0)
        return np.asarray(np.divide(walks, told, out=np.zeros_like(told), where=told > 0))

    def _finely(self, fit: Fit, x: Array) -> Fit:
        residuals = self.jury.residuals([Question(with_effects(self.nominal, fit.sizes(x)), self.takes, FINE)])[0]
        return replace(fit, x=x, cost=self._cost(residuals), residuals=residuals)

    def _cost(self, residuals: dict[int, Array]) -> dict[str, float]:
        return {use: self.jury.cost(residuals, use) for use in ("fit", "choose", "validate")}


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
